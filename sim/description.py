"""The YAML options of the simulator: ``robot``, ``lidar``, ``odometry``, ``camera``, ``topics``.

Defaults are those of TurtleBot3 in Gazebo, or the text says why not:

- Topics and their QoS: ``turtlebot3_gazebo/params/turtlebot3_burger_bridge.yaml`` of
  ROBOTIS-GIT/turtlebot3_simulations, bridged by ros_gz_bridge with its default QoS
  (reliable, volatile, depth 10: ``factory.hpp`` of gazebosim/ros_gz). Its ``/cmd_vel`` is a
  TwistStamped in Jazzy; the default here is Twist, as in the ROS tutorials.
- LiDAR: ``turtlebot3_burger/model.sdf`` there, with two differences. It casts 360 beams from
  0 to 6.28 rad, 1.0023 degrees apart; here they are exactly 1 degree apart, as those of the
  LDS-01. Its noise of 10 mm is off here unless asked for.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, PrivateAttr, model_validator

from grader.spec.quantity import (
    Angle,
    AngularSpeed,
    Duration,
    DurationOrZero,
    QuantityOf,
    Ratio,
    Speed,
)
from grader.spec.source import Model, read_source
from grader.spec.unit import Dimension
from sim.camera_options import CameraOptions
from sim.coordinates import Metres, PoseInPlane, PositiveMetres
from sim.motion import ORIGIN, Pose
from sim.sensor_options import (
    BatteryOptions,
    ImuOptions,
    JointOptions,
    RangeOptions,
    SensorOptions,
)
from sim.topic_options import LengthOrZero, Rate, TopicName, TopicOptions

_SPEED = QuantityOf(Dimension.SPEED, minimum=0.0, exclusive=True)
_ANGULAR_SPEED = QuantityOf(Dimension.ANGULAR_SPEED, minimum=0.0, exclusive=True)
_ACCELERATION = QuantityOf(Dimension.ACCELERATION, minimum=0.0, exclusive=True)
_ANGULAR_ACCELERATION = QuantityOf(Dimension.ANGULAR_ACCELERATION, minimum=0.0, exclusive=True)


class Layout(str, Enum):
    """Where the beams of a scan begin; they go counter-clockwise in both."""

    FROM_ZERO = "0..2pi"
    """Beam 0 is straight ahead (LDS-01, TurtleBot3 in Gazebo)."""
    FROM_MINUS_PI = "-pi..pi"
    """Beam 0 is straight behind, the middle one straight ahead."""


class NoReturn(str, Enum):
    """What a beam reports that measured no distance."""

    INF = "inf"
    """+inf beyond the range, -inf below it (REP-117, Gazebo)."""
    ZERO = "zero"
    """0.0 for both, as the real LDS-01."""


class OdometryOrigin(str, Enum):
    """Where the frame ``odom`` is."""

    WORLD = "world"
    """At the world's origin (Gazebo Classic)."""
    START = "start"
    """Where the robot started (the DiffDrive system of Gazebo Sim)."""


class Drive(Model):
    """A velocity command that the robot gets without a message on its topic.

    It is for scenarios in which the robot moves and the student's node only subscribes.
    """

    at: DurationOrZero = Field(description="Simulated time at which it acts.")
    linear: Speed = Field(0.0, description="Forward speed.", validate_default=False)
    angular: AngularSpeed = Field(
        0.0, description="Rate of turn, counter-clockwise.", validate_default=False
    )


class Push(Model):
    """A push that moves the robot besides its wheels; odometry shows it like any motion.

    For scenarios that distinguish a node that reads where the robot is from one that only counts.
    """

    after: PositiveMetres = Field(description="Way along its path after which it begins.")
    ahead: Metres = Field(0.0, description="How far it is pushed ahead; backwards is negative.")
    turn: Angle = Field(0.0, description="How far it is turned, counter-clockwise.")
    lasts: Duration = Field(0.3, description="How long the push takes.", validate_default=False)


class RobotOptions(Model):
    """The robot and where it starts."""

    model: Literal["burger", "waffle"] = Field("burger", description="Kind of TurtleBot3.")
    pose: PoseInPlane | None = Field(
        None, description="Start as [x, y, yaw]; by default the world's `start`."
    )
    radius: PositiveMetres | None = Field(
        None, description="Radius of the footprint; by default the model's."
    )
    max_speed: Annotated[float, _SPEED] | None = Field(None, description="Instead of the model's.")
    max_angular_speed: Annotated[float, _ANGULAR_SPEED] | None = Field(
        None, description="Instead of the model's."
    )
    max_acceleration: Annotated[float, _ACCELERATION] | None = Field(
        None, description="Instead of the model's; for braking too."
    )
    max_angular_acceleration: Annotated[float, _ANGULAR_ACCELERATION] | None = Field(
        None, description="Instead of the model's; for braking too."
    )
    command_timeout: Duration | None = Field(
        None,
        description="The robot stops after this time without a command. By default the last "
        "command stays active, as in Gazebo.",
    )
    drives: tuple[Drive, ...] = Field(
        (), description="Commands in addition to those on its topic; the newest counts."
    )
    pushes: tuple[Push, ...] = Field((), description="Pushes on its way.")


class LidarOptions(Model):
    """The LiDAR."""

    enabled: bool = Field(True, description="Whether there is one.")
    beams: int = Field(360, ge=1, le=3600, description="Beams of a full turn, evenly spaced.")
    rate: Rate = Field(5.0, description="Scans per second, at most 100 Hz.")
    range_min: PositiveMetres = Field(0.12, description="Smallest measured distance.")
    range_max: PositiveMetres = Field(3.5, description="Largest measured distance.")
    layout: Layout = Field(Layout.FROM_ZERO, description="Range of the beam angles.")
    no_return: NoReturn = Field(NoReturn.INF, description="What a beam without distance reports.")
    noise: LengthOrZero = Field(0.0, description="Standard deviation of a measured distance.")
    intensities: bool = Field(
        True,
        description="Whether `intensities` holds a number for each beam, as from the real LDS-01 "
        "and in Gazebo: smaller with distance, 0 without a return. Some drivers leave "
        "it empty.",
    )
    pose: PoseInPlane = Field(ORIGIN, description="Pose on the robot.")
    frame: str = Field("base_scan", min_length=1, description="`header.frame_id`.")
    starts: DurationOrZero = Field(0.0, description="No scan before this time.")
    stops: DurationOrZero | None = Field(None, description="No scan from this time on.")

    @model_validator(mode="after")
    def _consistent(self) -> LidarOptions:
        if self.range_min >= self.range_max:
            raise ValueError("range_min must be less than range_max")
        return self


class DriftOptions(Model):
    """Errors of the wheel odometry, drawn from the seed; by default none."""

    radius: Ratio = Field(
        0.0, description="Standard deviation of each wheel's radius, constant in a run."
    )
    separation: Ratio = Field(
        0.0, description="Standard deviation of the wheel separation, constant in a run."
    )
    slip: LengthOrZero = Field(
        0.0,
        description="Standard deviation of a wheel's distance after 1 m; it grows with the square "
        "root of the distance.",
    )


class CovarianceOptions(Model):
    """Variances that odometry reports, as in Gazebo Classic's diff drive (m² and rad²)."""

    x: float = Field(1e-5, ge=0.0)
    y: float = Field(1e-5, ge=0.0)
    yaw: float = Field(1e-3, ge=0.0)


class OdometryOptions(Model):
    """The wheel odometry."""

    enabled: bool = Field(True, description="Whether there is one.")
    rate: Rate = Field(30.0, description="Messages per second, at most 100 Hz.")
    frame: str = Field("odom", min_length=1, description="`header.frame_id`.")
    child_frame: str = Field("base_footprint", min_length=1, description="`child_frame_id`.")
    origin: OdometryOrigin = Field(
        OdometryOrigin.WORLD,
        description="Origin of `odom`: with `world`, odometry uses the coordinates of the world "
        "file.",
    )
    continuous: bool = Field(
        False,
        description="The quaternion is continuous when the robot turns, so `w` can be negative. By "
        "default `w` is never negative. Both mean the same rotation.",
    )
    drift: DriftOptions = Field(default_factory=DriftOptions, description="Errors.")
    covariance: CovarianceOptions = Field(
        default_factory=CovarianceOptions, description="Variances that are reported."
    )
    starts: DurationOrZero = Field(0.0, description="No odometry before this time.")
    stops: DurationOrZero | None = Field(None, description="No odometry from this time on.")


class CommandTopic(TopicOptions):
    """The topic of velocity commands."""

    topic: TopicName = Field("/cmd_vel", description="Fully qualified name.")
    type: Literal["geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"] = Field(
        "geometry_msgs/msg/Twist", description="A publisher of the other type does not match."
    )


class OdometryTopic(TopicOptions):
    """The topic of odometry."""

    topic: TopicName = Field("/odom", description="Fully qualified name.")


class ScanTopic(TopicOptions):
    """The topic of scans."""

    topic: TopicName = Field("/scan", description="Fully qualified name.")


class ClockTopic(TopicOptions):
    """The topic of simulated time, for nodes with ``use_sim_time``."""

    enabled: bool = Field(False, description="Whether it is published.")
    topic: TopicName = Field("/clock", description="Fully qualified name.")


class TransformTopic(TopicOptions):
    """The topics of transforms: `odom` to `base_footprint`, and what is fixed to the robot.

    They are published if the package tf2_msgs is installed. If a scenario has `tf` in its `topics`,
    they are always published, and recorded.
    """

    enabled: bool = Field(
        True, description="Whether they are published. Set it to false if students publish them."
    )
    topic: TopicName = Field("/tf", description="Fully qualified name.")
    static_topic: TopicName = Field("/tf_static", description="For what is fixed to the robot.")


class Topics(Model):
    """All topics."""

    command: CommandTopic = Field(default_factory=CommandTopic)
    odometry: OdometryTopic = Field(default_factory=OdometryTopic)
    scan: ScanTopic = Field(default_factory=ScanTopic)
    clock: ClockTopic = Field(default_factory=ClockTopic)
    tf: TransformTopic = Field(default_factory=TransformTopic)


# Heights above base_link in turtlebot3_description/urdf/turtlebot3_{burger,waffle}.urdf of
# ROBOTIS-GIT/turtlebot3, where base_link is 1 cm above base_footprint.
BASE_Z_M = 0.010
_SCAN_Z_M = {"burger": 0.172, "waffle": 0.122}


Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

_OPTICAL: Quaternion = (-0.5, 0.5, -0.5, 0.5)
"""From x ahead, y left, z up to z ahead, x right, y down."""


class SimulatorOptions(Model):
    """Everything about the simulator but the world."""

    robot: RobotOptions = Field(default_factory=RobotOptions)
    lidar: LidarOptions = Field(default_factory=LidarOptions)
    odometry: OdometryOptions = Field(default_factory=OdometryOptions)
    imu: ImuOptions | None = Field(None)
    joint_states: JointOptions | None = Field(None)
    battery: BatteryOptions | None = Field(None)
    ranges: tuple[RangeOptions, ...] = Field(())
    camera: CameraOptions | None = Field(None)
    topics: Topics = Field(default_factory=Topics)
    _prefix: str = PrivateAttr("")

    @property
    def fixed_frames(self) -> list[tuple[str, str, Pose, float]]:
        """What /tf_static says: parent, child, pose and height of the child, in metres."""
        base, link = self.odometry.child_frame, f"{self._prefix}base_link"
        frames = [(base, link, ORIGIN, BASE_Z_M)] if base != link else []
        frames.append((link, self.lidar.frame, self.lidar.pose, _SCAN_Z_M[self.robot.model]))
        for sensor in self.sensors:
            if sensor.frame != link:
                frames.append((link, sensor.frame, sensor.pose, sensor.height_m))
        return frames

    @property
    def camera_frames(self) -> list[tuple[str, str, Vector, Quaternion]]:
        """What /tf_static says of the camera: parent, child, position, quaternion (x, y, z, w)."""
        if self.camera is None:
            return []
        camera, half_pitch = self.camera, 0.5 * self.camera.pitch
        pitched = (0.0, math.sin(half_pitch), 0.0, math.cos(half_pitch))
        return [
            (f"{self._prefix}base_link", camera.link, camera.position, pitched),
            (camera.link, camera.frame, (0.0, 0.0, 0.0), _OPTICAL),
        ]

    @property
    def sensors(self) -> tuple[SensorOptions, ...]:
        """What it has besides LiDAR and odometry."""
        at_most_one_each = (self.imu, self.joint_states, self.battery)
        return (*(sensor for sensor in at_most_one_each if sensor is not None), *self.ranges)

    @property
    def transforms(self) -> set[tuple[str, str]]:
        """Parent and child of each transform that the robot publishes."""
        if not self.topics.tf.enabled:
            return set()
        fixed = {(parent, child) for parent, child, *_ in self.fixed_frames}
        fixed |= {(parent, child) for parent, child, *_ in self.camera_frames}
        return {(self.odometry.frame, self.odometry.child_frame), *fixed}

    def each(self, robots: Mapping[str, RobotOptions]) -> dict[str, SimulatorOptions]:
        """The same for each of several robots by name; ``""`` is the name of an only one."""
        if not robots:
            return {"": self}
        return {name: self._of_robot(name, robot) for name, robot in robots.items()}

    def _of_robot(self, name: str, robot: RobotOptions) -> SimulatorOptions:
        """The same for one of several robots: its topics and its frames begin with its name.

        The transforms of all robots are on the same two topics, as with the ``frame_prefix`` of
        robot_state_publisher, and there is one clock.
        """
        topics = {
            key: topic.model_copy(update={"topic": f"/{name}{topic.topic}"})
            for key, topic in self.topics
            if key not in ("tf", "clock")
        }
        frames = {
            "frame": f"{name}/{self.odometry.frame}",
            "child_frame": f"{name}/{self.odometry.child_frame}",
        }

        options = SimulatorOptions(
            robot=robot,
            lidar=self.lidar.model_copy(update={"frame": f"{name}/{self.lidar.frame}"}),
            odometry=self.odometry.model_copy(update=frames),
            imu=self.imu and self.imu.of(name),
            joint_states=self.joint_states and self.joint_states.of(name),
            battery=self.battery and self.battery.of(name),
            ranges=tuple(sensor.of(name) for sensor in self.ranges),
            camera=self.camera and self.camera.of(name),
            topics=self.topics.model_copy(update=topics),
        )
        options._prefix = f"{name}/"
        return options

    def start(self, world_start: Pose) -> Pose:
        """Where the robot starts in a world with this ``start``."""
        return self.robot.pose if self.robot.pose is not None else world_start


def read_options(file: Path) -> SimulatorOptions:
    """Read simulator options from a file of their own."""
    return read_source(file).read(SimulatorOptions)
