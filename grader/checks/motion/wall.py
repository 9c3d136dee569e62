"""The check of driving along a wall, at the right distance from it."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Literal

from pydantic import Field

from grader.checks.check import Subject, check
from grader.checks.motion.robot_check import RobotParameters, moved_in
from grader.checks.need import OfSimulator, SimulatedRobot
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.motion.off_course import why_off_course
from grader.findings.finding import Finding, Plot, evidence_at
from grader.findings.words import metres, percent
from grader.measure.motion.ground import nearest, nearest_m
from grader.measure.motion.track import STRIDE, over_time, way_m
from grader.recording.model import Recording
from grader.recording.simulated import Scene, Truth
from grader.spec.quantity import Length, PositiveLength, Ratio


class KeepsDistance(RobotParameters):
    """Parameters of motion.keeps_distance."""

    needs = (SimulatedRobot(), OfSimulator("map"))

    distance: PositiveLength = Field(
        description="Distance from the LiDAR to the nearest obstacle, such as the wall."
    )
    tolerance: Length = Field(0.1, description="How far the distance may be off.")
    side: Literal["left", "right", "any"] = Field(
        "any", description="On which side of the robot the obstacle is."
    )
    way: PositiveLength = Field(1.0, description="Least way that it drives at this distance.")
    share: Ratio = Field(
        0.9, description="Share of the way that must be at this distance, from when it first is."
    )

    def _asked(self) -> str:
        where = "" if self.side == "any" else f" on its {self.side}"
        return (
            f"drives {metres(self.way)} or more with the obstacle{where} at "
            f"{metres(self.distance)} ± {metres(self.tolerance)}"
        )


@check("motion.keeps_distance", Subject.RECORDING, KeepsDistance)
def keeps_distance(recording: Recording, parameters: KeepsDistance) -> Finding:
    """The robot keeps its distance from a wall.

    Judged by the true distance to the nearest obstacle, from the moment at which it is right for
    the first time. Way counts, not time: standing still neither helps nor costs.
    """
    scene = moved_in(recording)
    truth = recording.truth[::STRIDE]
    is_right = [_is_right(scene, step, parameters) for step in truth]
    plot = _distance_plot(recording, scene, parameters)
    if not any(is_right):
        shown = evidence_at(recording, "the run began", truth[0].time_ns, plot)
        seen = "it never was at this distance"
        away_m = [nearest_m(scene, step) for step in truth]
        known_m = [distance_m for distance_m in away_m if distance_m is not None]
        if known_m:
            seen += f", but from {metres(min(known_m))} to {metres(max(known_m))} away"
        return why_off_course(recording) or mistaken("never_at_distance", seen, shown)
    begin = is_right.index(True)
    judged, is_right = truth[begin:], is_right[begin:]
    whole_m, right_m = way_m(judged), _right_m(judged, is_right)
    ratio = right_m / whole_m if whole_m else 0.0
    since = f"the {metres(whole_m)} since it first was"
    seen = f"at this distance for {metres(right_m)} of {since} ({percent(round(ratio, 2))})"
    begin_s, end_s = (recording.since_launch_s(judged[index].time_ns) for index in (0, -1))
    plot = replace(plot, judged=(begin_s, end_s))
    evidence = evidence_at(recording, "first at this distance", judged[0].time_ns, plot)
    if right_m >= parameters.way and ratio >= parameters.share:
        return Finding.as_asked(seen, evidence)
    return why_off_course(recording) or mistaken("other_distance", seen, evidence)


def _is_right(scene: Scene, step: Truth, parameters: KeepsDistance) -> bool:
    sight = nearest(scene, step)
    if sight is None or abs(sight.distance_m - parameters.distance) > parameters.tolerance:
        return False
    side = "left" if sight.bearing_rad > 0.0 else "right"
    return parameters.side in ("any", side)


def _right_m(truth: tuple[Truth, ...], is_right: list[bool]) -> float:
    """The way that ends, from step to step, at the right distance."""
    legs = zip(pairwise(truth), is_right[1:], strict=True)
    return sum(way_m(leg) for leg, ends_right in legs if ends_right)


def _distance_plot(recording: Recording, scene: Scene, parameters: KeepsDistance) -> Plot:
    least_m = parameters.distance - parameters.tolerance
    most_m = parameters.distance + parameters.tolerance
    title, label = "Distance to the nearest obstacle", "distance (m)"
    return over_time(recording, title, label, partial(nearest_m, scene), (least_m, most_m))
