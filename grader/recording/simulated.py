"""What a recording holds of the simulator: the robot's true motion, and the scene."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from sim.motion import ORIGIN, Pose
from sim.shapes import MovingObstacle


@dataclass(frozen=True)
class Truth:
    """The simulated robot after one step of 10 ms, straight from the simulator's memory.

    Attributes:
        time_ns: End of the step, the same clock as the stamps of its messages.
        x_m: Position in the world's frame (REP-103: x forward, y left).
        y_m: Position in the world's frame.
        yaw_rad: Heading, counter-clockwise from the x axis, in (-pi, pi].
        linear_m_s: True forward speed.
        angular_rad_s: True rate of turn, counter-clockwise.
        command_m_s: Active commanded speed, before any limit.
        command_rad_s: Active commanded rate of turn, before any limit.
        contact: What the robot touches, such as ``boxes[2]``, or None.
        robot: Name of the robot, which is empty for the only one.
    """

    time_ns: int
    x_m: float
    y_m: float
    yaw_rad: float
    linear_m_s: float
    angular_rad_s: float
    command_m_s: float
    command_rad_s: float
    contact: str | None = None
    robot: str = ""


@dataclass(frozen=True)
class Incident:
    """Something that the simulator noted.

    Attributes:
        time_ns: When.
        kind: ``contact_began``, ``contact_ended``, ``command_rejected``, ``command_timeout``,
            ``pushed``, ``late`` (steps that ran late because of the machine, and were caught up)
            or ``forged_truth`` (a publisher of the student's where only a simulator is believed).
        text: For people.
        value: For ``late`` how late in seconds, else None.
        robot: Name of the robot, which is empty for the only one.
    """

    time_ns: int
    kind: str
    text: str
    value: float | None = None
    robot: str = ""


@dataclass(frozen=True)
class TurtleEvent:
    """What happened to a turtle besides its motion, which is in the truth.

    Attributes:
        time_ns: End of the step before whose motion it happened.
        kind: ``placed`` (it was there at first, or is there after a reset), ``spawned``,
            ``killed``, ``pen``, ``teleported``; of no turtle: ``cleared`` (all lines are gone),
            ``reset`` (all lines and turtles are gone), ``background``.
        turtle: Its name; empty for what is about all.
        x_m: Where the turtle is then, from the lower left corner.
        y_m: The same, upwards.
        yaw_rad: Its heading, counter-clockwise from the x axis.
        colour: Of its pen, or of the background: red, green and blue, from 0 to 255.
        width: Of the lines that it draws, in pixels; 45 pixels are 1 m.
        is_down: Whether its pen draws.
    """

    time_ns: int
    kind: str
    turtle: str = ""
    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0
    colour: tuple[int, int, int] = (0, 0, 0)
    width: int = 0
    is_down: bool = True


@dataclass(frozen=True)
class Filmed:
    """What pictures of the robot's camera are made of, beside its path: they are not recorded.

    Attributes:
        world: The world file, in JSON, with all values in it.
        options: The camera's options, in JSON.
        seed: Of the noise.
    """

    world: str
    options: str
    seed: tuple[int, ...]


@dataclass(frozen=True)
class Scene:
    """World and robot of a run, for drawing and judging.

    Attributes:
        radius_m: Of the robot's circular footprint.
        max_linear_m_s: Limit of the robot.
        max_angular_rad_s: Limit of the robot.
        outlines: Name of each thing that stands still -> its capsules: x1, y1, x2, y2, radius.
        moving: Everything that moves, with its shape and its script. Its place is a pure
            function of simulated time.
        began_ns: When simulated time began.
        lidar: Pose of the LiDAR in the robot's frame.
        command_topic: The velocity commands that the robot obeys.
        odometry_topic: Topic of its odometry.
        scan_topic: Topic of its scans.
        acceleration_m_s2: Limit of the robot, speeding up or braking.
        sensor_topics: Topics of its other sensors.
        lines: Points of each line on the floor, in the order of the world file.
        filmed: What pictures of its camera are made of, or None without a camera.
    """

    radius_m: float
    max_linear_m_s: float
    max_angular_rad_s: float
    outlines: Mapping[str, tuple[tuple[float, float, float, float, float], ...]]
    moving: tuple[MovingObstacle, ...]
    began_ns: int
    lidar: Pose = ORIGIN
    command_topic: str = "/cmd_vel"
    odometry_topic: str = "/odom"
    scan_topic: str = "/scan"
    acceleration_m_s2: float = 1.0
    sensor_topics: tuple[str, ...] = ()
    lines: tuple[tuple[tuple[float, float], ...], ...] = ()
    filmed: Filmed | None = None

    @property
    def published(self) -> tuple[str, ...]:
        """Every topic that its sensors publish on."""
        return (self.odometry_topic, self.scan_topic, *self.sensor_topics)
