"""The path of the robot in its world: headings, contacts, where it stopped and before what."""

from __future__ import annotations

import math
from bisect import bisect_left as _first
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

from markupsafe import Markup

from grader.checks.wording import counted, listing
from grader.measure.motion.ground import ahead
from grader.measure.motion.quantities import metres
from grader.measure.motion.track import first_rest, has_moved
from grader.recording.model import NS, Recording
from grader.recording.simulated import Scene, Truth
from grader.report.drawing import ground_plan
from grader.report.drawing.ground_plan import View, disc, in_metres, scale_bar, track
from grader.report.drawing.svg import (
    NARROW,
    WIDE,
    Figure,
    Point,
    crosses,
    drawing,
    element,
    label,
    simplified,
)
from grader.safe_text import one_line
from sim.motion import Pose, compose

STRIDE = 5
"""Steps of 10 ms from one drawn point to the next."""
MOST_POINTS = 600
TOLERANCE_M = 0.002
MOST_ARROWS = 14
LONGEST_SIGHT_M = 0.6
"""A thing farther ahead than this is not what the robot stopped for."""


@dataclass(frozen=True)
class Target:
    """Where a check wants the robot to end.

    Attributes:
        pose: In the world's frame.
    """

    pose: Pose
    radius_m: float


def draw_path(recording: Recording, targets: Sequence[Target], name: str) -> Figure | None:
    """Draw the path of the robot.

    Args:
        name: Unique in the document; letters, digits and hyphens.

    Returns:
        The drawing, or None in a scenario without a simulated robot.
    """
    scene, truth = recording.scene, recording.truth
    if scene is None or not truth:
        return None
    stride = max(STRIDE, len(truth) // MOST_POINTS)
    course = _Course(
        scene=scene,
        truth=truth,
        targets=targets,
        outline=simplified(
            [(step.x_m, step.y_m) for step in (*truth[::stride], truth[-1])], TOLERANCE_M
        ),
        gone_m=tuple(accumulate(map(_step_m, truth, truth[1:]), initial=0.0)),
        moved=has_moved(truth),
        stopped=_stopped(truth, scene),
        touched=_contacts(truth),
    )
    caption = _caption(course)
    title = f"Path of the robot in the scenario {recording.scenario}"
    return Figure(
        caption,
        _draw(course, title, caption, f"{name}-wide", WIDE),
        _draw(course, title, caption, f"{name}-narrow", NARROW),
    )


@dataclass(frozen=True)
class _Course:
    """What is to be drawn, whatever the width.

    Attributes:
        outline: Positions along the path, in metres; those on straight lines are left out.
        stopped: Where it first came to rest with something near ahead, and how far that was.
    """

    scene: Scene
    truth: Sequence[Truth]
    targets: Sequence[Target]
    outline: Sequence[Point]
    gone_m: Sequence[float]
    moved: bool
    stopped: tuple[Truth, float] | None
    touched: Sequence[Truth]

    @property
    def way_m(self) -> float:
        """Length of the path."""
        return self.gone_m[-1]


def _step_m(before: Truth, step: Truth) -> float:
    return math.hypot(step.x_m - before.x_m, step.y_m - before.y_m)


def _draw(course: _Course, title: str, caption: str, name: str, width: float) -> Markup:
    scene, truth, targets = course.scene, course.truth, course.targets
    view = ground_plan.fit(
        [*course.outline, *((target.pose.x_m, target.pose.y_m) for target in targets)],
        scene,
        width,
        lowest=150.0,
        highest=340.0 if width > NARROW else 300.0,
    )
    until_s = (truth[-1].time_ns - scene.began_ns) / NS
    in_world = [
        *ground_plan.world(scene, view),
        *ground_plan.moving(scene, until_s),
        *(disc(one.pose.x_m, one.pose.y_m, one.radius_m, "target") for one in targets),
        *(_needle(one.pose, 2.0 * scene.radius_m, "target-heading") for one in targets),
        track(course.outline, "way"),
        *robot(_pose(truth[0]), scene.radius_m, "robot at-start"),
        *robot(_pose(truth[-1]), scene.radius_m, "robot"),
    ]
    content = [in_metres(in_world, view)]
    content.append(element("path", d=_arrows(course, view), class_="arrow"))
    content += _stop(course, view)
    if course.touched:
        at = [view.pixel(step.x_m, step.y_m) for step in course.touched]
        content.append(crosses(at, "out", 6.0))
    content += scale_bar(view)
    for target in targets:
        content += _goal(view, target)
    if course.moved:
        content += _named(view, truth[0], "start", scene.radius_m)
    content += _named(view, truth[-1], "end", scene.radius_m)
    return drawing(name, title, caption, (view.width, view.height), content)


def robot(pose: Pose, radius_m: float, class_: str) -> list[Markup]:
    """Draw the robot, in metres: its outline, and a line to where it looks."""
    return [
        disc(pose.x_m, pose.y_m, radius_m, class_),
        _needle(pose, radius_m, f"{class_} nose"),
    ]


def _needle(pose: Pose, length_m: float, class_: str) -> Markup:
    tip = (
        pose.x_m + length_m * math.cos(pose.yaw_rad),
        pose.y_m + length_m * math.sin(pose.yaw_rad),
    )
    return track([(pose.x_m, pose.y_m), tip], class_)


def _pose(step: Truth) -> Pose:
    return Pose(step.x_m, step.y_m, step.yaw_rad)


def _named(view: View, step: Truth, text: str, radius_m: float) -> list[Markup]:
    x, y = view.pixel(step.x_m, step.y_m)
    below = y + radius_m * view.scale + 15.0
    y = below if below < view.height - 22.0 else y - radius_m * view.scale - 6.0
    return [label(text, x, y, "lane", "middle")]


def _goal(view: View, target: Target) -> list[Markup]:
    x, y = view.pixel(target.pose.x_m, target.pose.y_m)
    # Above its circle: below it stands the name of the robot that has come there.
    above = y - target.radius_m * view.scale - 6.0
    return [label("goal", x, max(12.0, above), "lane", "middle")]


def _arrows(course: _Course, view: View) -> str:
    """Small arrow heads along the path, evenly in length: which way the robot looked."""
    every_m = max(course.way_m / MOST_ARROWS, 30.0 / view.scale)
    path: list[str] = []
    at = 0
    while (at := _first(course.gone_m, course.gone_m[at] + every_m, at + 1)) < len(course.truth):
        step = course.truth[at]
        x, y = view.pixel(step.x_m, step.y_m)
        cos, sin = math.cos(step.yaw_rad), -math.sin(step.yaw_rad)
        # A head of 8 by 8 pixels around the point.
        left = (x - 4.0 * cos - 4.0 * sin, y - 4.0 * sin + 4.0 * cos)
        right = (x - 4.0 * cos + 4.0 * sin, y - 4.0 * sin - 4.0 * cos)
        tip = (x + 4.0 * cos, y + 4.0 * sin)
        path.append("M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in (left, tip, right)))
    return "".join(path)


def _contacts(truth: Sequence[Truth]) -> list[Truth]:
    """The first step of every contact."""
    return [
        step
        for before, step in zip((None, *truth), truth, strict=False)
        if step.contact and (before is None or before.contact is None)
    ]


def _stopped(truth: Sequence[Truth], scene: Scene) -> tuple[Truth, float] | None:
    """Where the robot first came to rest with something near ahead, and how far that was."""
    rest = first_rest(truth)
    if rest is None:
        return None
    step = truth[rest]
    sight = ahead(scene, step)
    if sight is None or sight.distance_m > LONGEST_SIGHT_M:
        return None
    return step, sight.distance_m


def _stop(course: _Course, view: View) -> list[Markup]:
    if course.stopped is None:
        return []
    scene, (step, distance_m) = course.scene, course.stopped
    eye = compose(_pose(step), scene.lidar)
    x1, y1 = view.pixel(eye.x_m, eye.y_m)
    x2, y2 = view.pixel(
        eye.x_m + distance_m * math.cos(step.yaw_rad),
        eye.y_m + distance_m * math.sin(step.yaw_rad),
    )
    high = min(y1, y2) - scene.radius_m * view.scale - 8.0
    return [
        element("line", x1=x1, y1=y1, x2=x2, y2=y2, class_="measure"),
        label(metres(distance_m), (x1 + x2) / 2.0, max(12.0, high), "lane", "middle"),
    ]


def _caption(course: _Course) -> str:
    goal = "".join(_from_goal(course.truth[-1], target) for target in course.targets)
    if not course.moved:
        return f"The robot did not move.{goal}"
    parts = [f"The robot went {metres(course.way_m)}"]
    if course.stopped is not None:
        parts.append(f"stopped with an obstacle {metres(course.stopped[1])} ahead of its LiDAR")
    text = " and ".join(parts)
    if course.touched:
        names = listing(one_line(step.contact or "") for step in course.touched)
        text += f"; {counted(len(course.touched), 'contact')} with {names} (marked ×)"
    arrows = "Arrow heads show where it looked, the dashed outline where it started."
    return f"{text}.{goal} {arrows}"


def _from_goal(end: Truth, target: Target) -> str:
    """How far from a goal the robot ended."""
    away_m = math.hypot(end.x_m - target.pose.x_m, end.y_m - target.pose.y_m)
    return (
        f" It ended {metres(away_m)} from the goal; the dashed circle is what is near enough, "
        f"{metres(target.radius_m)}."
    )
