"""The YAML options of what a robot has besides LiDAR and odometry.

IMU, wheel joints and battery are those of TurtleBot3, or the text says why not:

- IMU: place and frame of ``turtlebot3_burger/model.sdf`` in ROBOTIS-GIT/turtlebot3_simulations. It
  publishes at 200 Hz there, with a noise of 0.2 mrad/s and 17 mm/s²; here at 50 Hz, without noise
  unless it is asked for.
- Joints: names and wheel radius of the same files.
- Battery: a LiPo of 11.1 V and 1.8 Ah that lasts two and a half hours (ROBOTIS e-Manual,
  TurtleBot3, "Features"). Gazebo has none.
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator
from typing_extensions import Self

from grader.spec.quantity import Angle, AngularSpeed, Duration, Frequency, QuantityOf, Ratio
from grader.spec.source import Model
from grader.spec.unit import Dimension
from sim.coordinates import PoseInPlane, PositiveMetres
from sim.motion import ORIGIN, Pose
from sim.topic_options import LengthOrZero, Timed, TopicName, TopicOptions

Acceleration = Annotated[float, QuantityOf(Dimension.ACCELERATION, minimum=0.0)]


class SensorOptions(TopicOptions, Timed):
    """A sensor with a topic of its own."""

    interface: ClassVar[str]
    """What it publishes."""
    height_m: ClassVar[float] = 0.0
    """Of its frame, above base_link."""

    pose: PoseInPlane = Field(ORIGIN, description="Pose on the robot.")
    frame: str = Field("base_link", min_length=1, description="`header.frame_id`.")

    def of(self, robot: str) -> Self:
        """The same for one of several robots."""
        own = {"topic": f"/{robot}{self.topic}", "frame": f"{robot}/{self.frame}"}
        return self.model_copy(update=own)


class ImuNoise(Model):
    """Standard deviations of what an IMU measures; by default none."""

    angular: AngularSpeed = Field(
        0.0, ge=0.0, description="Of the rate of turn.", validate_default=False
    )
    linear: Acceleration = Field(
        0.0, description="Of the acceleration, along each axis.", validate_default=False
    )


class ImuOptions(SensorOptions):
    """An IMU: heading, rate of turn and acceleration, with that of gravity along z."""

    interface: ClassVar[str] = "sensor_msgs/msg/Imu"
    height_m: ClassVar[float] = 0.068

    topic: TopicName = Field("/imu", description="Fully qualified name.")
    rate: Annotated[Frequency, Field(le=100.0)] = Field(
        50.0, description="Messages per second, at most 100 Hz."
    )
    pose: PoseInPlane = Field(Pose(-0.032, 0.0, 0.0), description="Pose on the robot.")
    frame: str = Field("imu_link", min_length=1, description="`header.frame_id`.")
    noise: ImuNoise = Field(default_factory=ImuNoise, description="Errors.")


class JointOptions(SensorOptions):
    """The two wheel joints, `wheel_left_joint` and `wheel_right_joint`."""

    interface: ClassVar[str] = "sensor_msgs/msg/JointState"

    topic: TopicName = Field("/joint_states", description="Fully qualified name.")
    rate: Annotated[Frequency, Field(le=100.0)] = Field(
        30.0, description="Messages per second, at most 100 Hz."
    )
    wheel_radius: PositiveMetres = Field(0.033, description="Radius of the wheels.")


class BatteryOptions(SensorOptions):
    """A battery that loses its charge evenly."""

    interface: ClassVar[str] = "sensor_msgs/msg/BatteryState"

    topic: TopicName = Field("/battery_state", description="Fully qualified name.")
    rate: Annotated[Frequency, Field(le=100.0)] = Field(
        1.0, description="Messages per second, at most 100 Hz."
    )
    charge: Annotated[Ratio, Field(le=1.0)] = Field(1.0, description="Charge at the start.")
    lasts: Duration = Field(9000.0, description="Time from a full battery to an empty one.")


class RangeOptions(SensorOptions):
    """A distance sensor such as a sonar: the nearest thing in a cone."""

    interface: ClassVar[str] = "sensor_msgs/msg/Range"
    height_m: ClassVar[float] = 0.05

    topic: TopicName = Field(description="Fully qualified name.")
    rate: Annotated[Frequency, Field(le=100.0)] = Field(
        10.0, description="Messages per second, at most 100 Hz."
    )
    frame: str = Field(min_length=1, description="`header.frame_id`.")
    radiation: Literal["ultrasound", "infrared"] = Field(
        "ultrasound", description="How it measures."
    )
    fov: Annotated[Angle, Field(gt=0.0, le=math.pi)] = Field(
        math.radians(15.0), description="Width of the cone, at most 180 degrees."
    )
    range_min: PositiveMetres = Field(0.02, description="Smallest measured distance.")
    range_max: PositiveMetres = Field(4.0, description="Largest measured distance.")
    noise: LengthOrZero = Field(0.0, description="Standard deviation of a measured distance.")

    @model_validator(mode="after")
    def _consistent(self) -> RangeOptions:
        if self.range_min >= self.range_max:
            raise ValueError("range_min must be less than range_max")
        return self
