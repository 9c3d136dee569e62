"""One of several robots: the recording as if it had been alone in a world where others move."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from grader.recording.model import Recording
from sim.motion import Pose
from sim.shapes import ROBOT_HEIGHT_M, ROBOT_PAINT, ROBOTS, MovingObstacle, Waypoint

_STRIDE = 5
"""Steps of 10 ms from one kept place of another robot to the next; it drives straight between."""


def of_robot(recording: Recording, name: str) -> Recording:
    """The truth, the scene and the incidents of one robot; the others are obstacles that move."""
    scene = recording.scenes[name]
    others = tuple(_obstacle(recording, other) for other in recording.scenes if other != name)
    return replace(
        recording,
        truth=tuple(step for step in recording.truth if step.robot == name),
        incidents=tuple(item for item in recording.incidents if item.robot == name),
        scenes={name: replace(scene, moving=(*scene.moving, *others))},
    )


def each_robot(recording: Recording) -> Iterator[Recording]:
    """The same for each robot in turn; the recording itself where there is one or none."""
    if len(recording.scenes) < 2:
        yield recording
    else:
        yield from (of_robot(recording, name) for name in recording.scenes)


def _obstacle(recording: Recording, name: str) -> MovingObstacle:
    """A robot as a pillar that goes its way."""
    scene = recording.scenes[name]
    steps = [step for step in recording.truth if step.robot == name]
    path = tuple(
        Waypoint(step.time_ns - scene.began_ns, Pose(step.x_m, step.y_m, step.yaw_rad))
        for step in (*steps[::_STRIDE], *steps[-1:])
    )
    return MovingObstacle(
        f"{ROBOTS}[{name}]", path, scene.radius_m, height_m=ROBOT_HEIGHT_M, colour=ROBOT_PAINT
    )
