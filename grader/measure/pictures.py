"""What the robot's camera saw: made again from the recording, bit by bit, as none is recorded.

Other robots are where :mod:`grader.recording.one_robot` has them, to a millimetre or so.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from grader.recording.simulated import Scene, Truth
from sim.camera import Camera, Picture
from sim.camera_options import CameraOptions
from sim.motion import Pose
from sim.world import parse_world


def camera_of(scene: Scene, **changes: Any) -> Camera | None:
    """The camera of a run, or None without one.

    Args:
        changes: Options that differ from those of the run.
    """
    if scene.filmed is None:
        return None
    options = CameraOptions.model_validate_json(scene.filmed.options)
    changed = options.model_copy(update=changes)
    world = replace(parse_world(scene.filmed.world), moving=scene.moving)
    return Camera(world, changed, scene.filmed.seed)


def picture_at(camera: Camera, scene: Scene, step: Truth) -> Picture:
    """What the camera sees after a step."""
    pose = Pose(step.x_m, step.y_m, step.yaw_rad)
    return camera.picture(pose, step.time_ns - scene.began_ns)
