"""The path of the robot in its world: headings, contacts, where it stopped, where it should be."""

from __future__ import annotations

import contextlib
import math
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise

from markupsafe import Markup
from pydantic import TypeAdapter, ValidationError

from grader.assignment.model import Assignment, Visibility
from grader.assignment.random_values import fixed_values
from grader.checks.motion.place import Place
from grader.findings.reference import Goal, GoalPose, UnknownValue
from grader.findings.words import counted, listing, metres
from grader.measure.motion.ground import ahead
from grader.measure.motion.track import first_rest, has_moved
from grader.recording.model import NS, Recording
from grader.recording.simulated import Scene, Truth
from grader.report.drawing import ground_plan, svg
from grader.report.drawing.ground_plan import View, disc, track
from grader.spec.quantity import PositiveLength
from sim.motion import Pose, compose
from sim.shapes import ROBOTS, obstacle_words

_GOAL: TypeAdapter[Goal] = TypeAdapter(GoalPose)
_PLACES: TypeAdapter[tuple[Place, ...]] = TypeAdapter(tuple[Place, ...])
_LENGTH: TypeAdapter[float] = TypeAdapter(PositiveLength)
DEFAULT_M = 0.1


def targets(
    assignment: Assignment, scenario: str, values: Mapping[str, float], robot: str = ""
) -> tuple[Target, ...]:
    """The goals and places that visible checks name for a robot in a scenario, each once."""
    found: dict[tuple[Pose, str], Target] = {}
    fixed = next((fixed_values(one) for one in assignment.scenarios if one.id == scenario), {})
    values = {**fixed, **values}
    # A check that says how near goes before one that leaves it to the default.
    for check in sorted(assignment.checks, key=lambda check: "position" not in check.with_):
        judged = not check.scenarios or scenario in check.scenarios
        judged &= check.robot in (None, robot)
        if not judged or check.visibility is not Visibility.VISIBLE:
            continue
        # An author's own check may call something else a goal, or a place.
        with contextlib.suppress(ValidationError, UnknownValue):
            radius_m = _LENGTH.validate_python(check.with_.get("position", f"{DEFAULT_M} m"))
            if "goal" in check.with_:
                pose = _GOAL.validate_python(check.with_["goal"]).pose(values)
                found.setdefault((pose, "goal"), Target(pose, radius_m))
            for number, place in enumerate(_PLACES.validate_python(check.with_.get("places", ()))):
                pose = Pose(place.middle.x_m, place.middle.y_m, 0.0)
                one = Target(pose, radius_m, str(number + 1), place.bounds)
                found.setdefault((one.pose, one.label), one)
    return tuple(found.values())


STRIDE = 5
"""Steps of 10 ms from one drawn point to the next."""
MOST_POINTS = 600
TOLERANCE_M = 0.002
MOST_ARROWS = 14
LONGEST_SIGHT_M = 0.6
"""A thing farther ahead than this is not what the robot stopped for."""


@dataclass(frozen=True)
class Target:
    """Where a check wants the robot to be; ``pose`` in the world's frame.

    Attributes:
        label: ``goal``, where it must end, or the number of a place on its way.
        zone: Of a place that is a rectangle: x_min, y_min, x_max, y_max.
    """

    pose: Pose
    radius_m: float
    label: str = "goal"
    zone: tuple[float, ...] = ()

    @property
    def is_goal(self) -> bool:
        """Whether the robot must end there."""
        return self.label == "goal"

    @property
    def corners(self) -> list[svg.Point]:
        """Those of a zone, or the middle."""
        if not self.zone:
            return [(self.pose.x_m, self.pose.y_m)]
        x1, y1, x2, y2 = self.zone
        return [(x1, y1), (x2, y1), (x2, y2), (x1, y2)]

    @property
    def outline(self) -> Markup:
        """Its tolerance or its zone, in metres."""
        if self.zone:
            return track([*self.corners, self.corners[0]], "target")
        return disc(self.pose.x_m, self.pose.y_m, self.radius_m, "target")


def draw_path(recording: Recording, targets: Sequence[Target], name: str) -> svg.Figure | None:
    """Draw the path of the robot; None in a scenario without a simulated robot."""
    scene, truth = recording.scene, recording.truth
    if scene is None or not truth:
        return None
    stride = max(STRIDE, len(truth) // MOST_POINTS)
    outline = svg.simplified(
        [(step.x_m, step.y_m) for step in (*truth[::stride], truth[-1])], TOLERANCE_M
    )
    steps_m = (math.hypot(b.x_m - a.x_m, b.y_m - a.y_m) for a, b in pairwise(truth))
    gone_m = [*accumulate(steps_m, initial=0.0)]
    touched = [b for a, b in pairwise([None, *truth]) if b and b.contact and not (a and a.contact)]
    stopped = _stopped(truth, scene)
    until_ns = truth[-1].time_ns - scene.began_ns
    # Another robot is what the run is about; an obstacle may be far away.
    others = [one.pose_at(until_ns) for one in scene.moving if one.label.startswith(ROBOTS)]
    shown = [*outline, *(corner for one in targets for corner in one.corners)]
    shown += [(other.x_m, other.y_m) for other in others if other is not None]
    goals = [one for one in targets if one.is_goal]
    robot = f"robot {recording.robot}".rstrip()

    def draw(width: float) -> tuple[float, list[Markup]]:
        view = ground_plan.fit(shown, scene, width, 150.0, 340.0 if width > svg.NARROW else 300.0)
        in_world = [
            *ground_plan.world(scene, view),
            *ground_plan.moving(scene, until_ns / NS),
            *(one.outline for one in targets),
            *(_needle(one.pose, 2.0 * scene.radius_m, "target-heading") for one in goals),
            track(outline, "way"),
            *_robot(truth[0], scene, "robot at-start"),
            *_robot(truth[-1], scene, "robot"),
        ]
        content = [svg.element("g", *in_world, transform=view.matrix)]
        content.append(svg.element("path", d=_arrows(truth, gone_m, view), class_="arrow"))
        if stopped:
            content += _stop(*stopped, scene, view)
        if touched:
            at = [view.pixel(step.x_m, step.y_m) for step in touched]
            content.append(svg.crosses(at, "out", 6.0))
        content += ground_plan.scale_bar(view)
        for one in targets:
            # Above its circle: below it stands the name of the robot that has come there.
            x, y = view.pixel(one.pose.x_m, one.pose.y_m)
            above = one.radius_m * view.scale + 6.0 if one.is_goal else -4.0
            content.append(svg.label(one.label, x, max(12.0, y - above), "lane", "middle"))
        for step, text in ((truth[0], "start"), (truth[-1], "end"))[not has_moved(truth) :]:
            x, y = view.pixel(step.x_m, step.y_m)
            radius = scene.radius_m * view.scale
            y = y + radius + 15.0 if y + radius + 15.0 < view.height - 22.0 else y - radius - 6.0
            content.append(svg.label(text, x, y, "lane", "middle"))
        return view.height, content

    goal = "".join(_from_goal(truth[-1], target) for target in goals)
    if len(goals) < len(targets):
        goal += " The numbers are the places to visit, in the order of the assignment."
    if has_moved(truth):
        went = _went(gone_m[-1], stopped, touched)
        caption = f"The {robot} {went}.{goal} Arrow heads show where it looked, "
        caption += "the dashed outline where it started."
    else:
        caption = f"The {robot} did not move.{goal}"
    title = f"Path of the {robot} in the scenario {recording.scenario}"
    return svg.figure(name, title, caption, draw)


def _robot(step: Truth, scene: Scene, class_: str) -> list[Markup]:
    """The robot, in metres: its outline, and a line to where it looks."""
    return [
        disc(step.x_m, step.y_m, scene.radius_m, class_),
        _needle(_pose(step), scene.radius_m, f"{class_} nose"),
    ]


def _needle(pose: Pose, length_m: float, class_: str) -> Markup:
    tip = compose(pose, Pose(length_m, 0.0, 0.0))
    return track([(pose.x_m, pose.y_m), (tip.x_m, tip.y_m)], class_)


def _pose(step: Truth) -> Pose:
    return Pose(step.x_m, step.y_m, step.yaw_rad)


def _arrows(truth: Sequence[Truth], gone_m: Sequence[float], view: View) -> str:
    """Small arrow heads along the path, evenly in length: which way the robot looked."""
    every_m = max(gone_m[-1] / MOST_ARROWS, 30.0 / view.scale)
    path: list[str] = []
    at = 0
    while (at := bisect_left(gone_m, gone_m[at] + every_m, at + 1)) < len(truth):
        step = truth[at]
        x, y = view.pixel(step.x_m, step.y_m)
        cos, sin = 4.0 * math.cos(step.yaw_rad), -4.0 * math.sin(step.yaw_rad)
        # A head of 8 by 8 pixels around the point.
        left, right = (x - cos - sin, y - sin + cos), (x - cos + sin, y - sin - cos)
        corners = (left, (x + cos, y + sin), right)
        path.append("M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in corners))
    return "".join(path)


def _stopped(truth: Sequence[Truth], scene: Scene) -> tuple[Truth, float] | None:
    """Where the robot first came to rest with something near ahead, and how far that was."""
    rest = first_rest(truth)
    sight = ahead(scene, truth[rest]) if rest is not None else None
    if rest is None or sight is None or sight.distance_m > LONGEST_SIGHT_M:
        return None
    return truth[rest], sight.distance_m


def _stop(step: Truth, distance_m: float, scene: Scene, view: View) -> list[Markup]:
    """A line from the LiDAR to what the robot stopped for, with its length."""
    eye = compose(_pose(step), scene.lidar)
    x1, y1 = view.pixel(eye.x_m, eye.y_m)
    cos, sin = math.cos(step.yaw_rad), math.sin(step.yaw_rad)
    x2, y2 = view.pixel(eye.x_m + distance_m * cos, eye.y_m + distance_m * sin)
    above = max(12.0, min(y1, y2) - scene.radius_m * view.scale - 8.0)
    return [
        svg.line(x1, y1, x2, y2, "measure"),
        svg.label(metres(distance_m), (x1 + x2) / 2.0, above, "lane", "middle"),
    ]


def _went(way_m: float, stopped: tuple[Truth, float] | None, touched: Sequence[Truth]) -> str:
    text = f"went {metres(way_m)}"
    if stopped is not None:
        text += f" and stopped with an obstacle {metres(stopped[1])} ahead of its LiDAR"
    if touched:
        names = listing(obstacle_words(step.contact or "") for step in touched)
        text += f"; {counted(len(touched), 'contact')} with {names} (marked ×)"
    return text


def _from_goal(end: Truth, target: Target) -> str:
    """How far from a goal the robot ended."""
    away_m = math.hypot(end.x_m - target.pose.x_m, end.y_m - target.pose.y_m)
    return (
        f" It ended {metres(away_m)} from the goal; the dashed circle is the tolerance, "
        f"{metres(target.radius_m)}."
    )
