"""The YAML options of a camera.

Topics, field of view, place on the robot and frames are those of
``turtlebot3_waffle/model.sdf`` in ROBOTIS-GIT/turtlebot3_simulations and of
``turtlebot3_description/urdf/turtlebot3_waffle.urdf`` in ROBOTIS-GIT/turtlebot3. It takes
1920 x 1080 pixels at 30 Hz there; here they are 320 x 240 at 10 Hz, for a core that many runs
share. ``camera_link`` is where these files have ``camera_rgb_frame``, 2 cm beside their
``camera_link``. Its noise of 0.7 % is off here unless asked for.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field
from typing_extensions import Self

from grader.spec.quantity import Angle, Frequency, Ratio
from sim.coordinates import Position, PositiveMetres
from sim.topic_options import LengthOrZero, Timed, TopicName, TopicOptions


class ObjectsOptions(TopicOptions):
    """What a logical camera reports: which things stand in view, and where."""

    topic: TopicName = Field("/camera/objects", description="Fully qualified name.")
    range: PositiveMetres = Field(3.0, description="How far away a thing may be.")
    noise: LengthOrZero = Field(
        0.0, description="Standard deviation of each coordinate of its place."
    )


class CameraOptions(TopicOptions, Timed):
    """A camera. Without this key there is none; `camera: {}` is one.

    Pictures are made only while somebody subscribes, and are not recorded: a report makes them
    again from the true path and the seed.
    """

    topic: TopicName = Field(
        "/camera/image_raw",
        description="Fully qualified name. With `/compressed` after it, it is the topic of the "
        "same pictures as PNG.",
    )
    info_topic: TopicName = Field(
        "/camera/camera_info", description="What is known of the camera, with each picture."
    )
    rate: Annotated[Frequency, Field(le=10.0)] = Field(
        10.0, description="Pictures per second, at most 10 Hz."
    )
    width: int = Field(320, ge=16, le=320, description="Columns of pixels.")
    height: int = Field(240, ge=16, le=240, description="Rows of pixels.")
    fov: Annotated[Angle, Field(ge=math.radians(10.0), le=math.radians(150.0))] = Field(
        1.02974, description="Horizontal field of view, from 10 to 150 degrees."
    )
    position: Position = Field(
        (0.069, -0.047, 0.107), description="Place on the robot, in `base_link`."
    )
    pitch: Annotated[Angle, Field(ge=math.radians(-80.0), le=math.radians(80.0))] = Field(
        0.0, description="How far it looks down, at most 80 degrees."
    )
    encoding: Literal["rgb8", "bgr8"] = Field(
        "rgb8", description="Of `sensor_msgs/msg/Image`. The compressed one is always PNG."
    )
    noise: Annotated[Ratio, Field(le=0.5)] = Field(
        0.0,
        description="Standard deviation of a pixel's brightness, as a share of white. All three "
        "colours of a pixel get the same, as in Gazebo. At most 50 %.",
    )
    objects: ObjectsOptions | None = Field(
        None,
        description="A logical camera beside it, which reports the boxes, pillars and other "
        "obstacles in view as a `visualization_msgs/msg/MarkerArray`. By default there is none.",
    )
    link: str = Field("camera_link", min_length=1, description="Frame of its body: x is ahead.")
    frame: str = Field(
        "camera_rgb_optical_frame",
        min_length=1,
        description="`header.frame_id`, an optical frame: z is ahead, x right, y down (REP-103).",
    )

    @property
    def compressed_topic(self) -> str:
        """As image_transport names it."""
        return f"{self.topic}/compressed"

    @property
    def topics(self) -> tuple[str, ...]:
        """Every topic that it publishes on."""
        others = () if self.objects is None else (self.objects.topic,)
        return (self.topic, self.compressed_topic, self.info_topic, *others)

    def of(self, robot: str) -> Self:
        """The same for one of several robots."""
        own: dict[str, object] = {
            **{key: f"/{robot}{getattr(self, key)}" for key in ("topic", "info_topic")},
            **{key: f"{robot}/{getattr(self, key)}" for key in ("link", "frame")},
        }
        if self.objects is not None:
            topic = f"/{robot}{self.objects.topic}"
            own["objects"] = self.objects.model_copy(update={"topic": topic})
        return self.model_copy(update=own)
