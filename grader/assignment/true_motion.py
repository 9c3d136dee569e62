"""What a simulator of the author's tells of the robot in it: keys of ``simulator``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from grader.spec.name import QualifiedNodeName, TopicName
from grader.spec.quantity import Duration, PositiveLength, QuantityOf, Ratio
from grader.spec.source import Model
from grader.spec.unit import Dimension
from sim.description import CommandTopic, OdometryTopic, ScanTopic

POSE_TYPES = Literal[
    "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/Pose",
    "tf2_msgs/msg/TFMessage",
]
CLOCK, CONTACT = "rosgraph_msgs/msg/Clock", "std_msgs/msg/Bool"

_Speed = Annotated[float, QuantityOf(Dimension.SPEED, minimum=0.0, exclusive=True)]
_Turn = Annotated[float, QuantityOf(Dimension.ANGULAR_SPEED, minimum=0.0, exclusive=True)]
_Acceleration = Annotated[float, QuantityOf(Dimension.ACCELERATION, minimum=0.0, exclusive=True)]


class TruthTopic(Model):
    """The topic with the true pose of the robot in the world's frame."""

    topic: TopicName = Field(description="Fully qualified name.")
    type: POSE_TYPES = Field(description="Its type.")
    frame: str | None = Field(
        None, description="For `tf2_msgs/msg/TFMessage`: `child_frame_id` of the robot's transform."
    )

    @model_validator(mode="after")
    def _whose(self) -> TruthTopic:
        if (self.frame is None) == (self.type == "tf2_msgs/msg/TFMessage"):
            raise ValueError("'frame' goes with the type tf2_msgs/msg/TFMessage, and with no other")
        return self


class Ready(Model):
    """What has to be there before the student's programs start, besides a true pose."""

    topic: TopicName | None = Field(None, description="A topic on which it has sent a message.")
    node: QualifiedNodeName | None = Field(None, description="One of its nodes.")
    service: TopicName | None = Field(None, description="A service.")


class TrueMotion(Model):
    """What a simulator tells of its robot, and what the robot is like."""

    truth: TruthTopic = Field(
        description="Where the robot really is. Only what the simulator itself publishes counts."
    )
    contact: TopicName | None = Field(
        None,
        description="Topic of `std_msgs/msg/Bool`: whether the robot touches something. Without it "
        "no check can judge contacts.",
    )
    clock: TopicName | None = Field(
        None,
        description="Topic of its simulated time, such as `/clock`, to watch how fast that runs. "
        "The student's nodes need `parameters: {use_sim_time: true}` in `launch`.",
    )
    slowest: Ratio = Field(
        0.9,
        description="Real time factor of the clock below which a run is an error and is repeated.",
    )
    command: CommandTopic = Field(
        default_factory=CommandTopic, description="Topic of velocity commands. It is recorded."
    )
    odometry: OdometryTopic | None = Field(
        None, description="Topic of odometry, if it has one. It is recorded."
    )
    scan: ScanTopic | None = Field(
        None, description="Topic of laser scans, if it has one. It is recorded."
    )
    ready: Ready = Field(
        default_factory=Ready,
        description="What has to be there before the student's programs start, besides a true "
        "pose and a message on `clock`.",
    )
    within: Duration = Field(60.0, description="Longest time until it is ready.")
    radius: PositiveLength = Field(description="Radius of the robot's footprint.")
    max_speed: _Speed = Field(description="Largest speed of the robot.")
    max_angular_speed: _Turn = Field(description="Largest rate of turn of the robot.")
    max_acceleration: _Acceleration = Field(
        1.0, description="Largest acceleration of the robot, in m/s².", validate_default=False
    )
    map: str | None = Field(
        None,
        description="World file of rosgrade with what stands in the simulated world, to draw it, "
        "and to measure distances. It simulates nothing.",
    )
