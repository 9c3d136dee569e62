"""Why the robot does not look as it must at its goal."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

from grader.checks.finding import Evidence
from grader.checks.first_seen import until_the_end
from grader.diagnosis.cause import Cause
from grader.diagnosis.explanation import Symptom, cause_of, explanation
from grader.diagnosis.motion.misread_yaw import misread_yaw
from grader.diagnosis.motion.off_course import why_off_course
from grader.measure.motion.approach import Approach
from grader.measure.motion.detour import WRAP_HINT
from grader.measure.motion.quantities import degrees, turn
from grader.measure.motion.track import is_at_rest, turned_rad, turns_one_way
from grader.recording.model import NS
from grader.recording.simulated import Truth
from sim.motion import wrap_angle

_WEAVES = 4
# Share of the way: who ends so near the goal knows where it is.
_A_LITTLE = 0.25
# As far from the heading of the goal, in rad, as a tolerance may reasonably leave it.
_A_LITTLE_RAD = 0.15
_STRAIGHT_RAD_S = 0.02
_ASTRAY_RAD = math.radians(30.0)
# So long after it was there a node may see it at the latest: odometry, a timer of 10 Hz, and some
# of the machine's doing.
_SEEN_LATE_NS = 300 * NS // 1000
# How far from the heading that it was sent to a robot rests: the default of angle_tolerance.
_AS_SENT_RAD = 0.06
# An error of angle that a proportional controller has done away with.
_EXACTLY_RAD = 3e-3
_YAW_HINT = (
    "Print yaw while it turns: it has to go with the robot, from -pi to pi. A quaternion in ROS is "
    "x, y, z, w; yaw = atan2(2 (w z + x y), 1 - 2 (y y + z z)), and z alone is no angle."
)


@dataclass(frozen=True)
class HeadingMissed(Symptom[Cause]):
    """The robot is at the goal, but looks another way."""

    run: Approach
    position_m: float
    heading_rad: float

    @property
    def last(self) -> Truth:
        """The end of the way."""
        return self.run.truth[-1]

    @property
    def seen(self) -> str:
        """The symptom in words."""
        return (
            f"is at the goal's position, but looks to {degrees(self.last.yaw_rad)} instead of "
            f"{degrees(self.run.goal.yaw_rad)}"
        )

    @property
    def evidence(self) -> Evidence:
        """The heading over time."""
        moments = (until_the_end(self.run.recording),)
        return Evidence(moments=moments, plots=(self.run.heading_plot,))

    def looks_as(self, heading_rad: float) -> bool:
        """Whether it looks that way, which is not the way of the goal."""
        near_rad = min(self.heading_rad, _AS_SENT_RAD)
        return abs(wrap_angle(heading_rad - self.run.goal.yaw_rad)) > 2.0 * self.heading_rad and (
            abs(wrap_angle(heading_rad - self.last.yaw_rad)) <= near_rad
        )


def why_not_aligned(run: Approach, position_m: float, heading_rad: float) -> Cause | None:
    """Why the robot does not look as the goal does in the end; None if it does."""
    if abs(run.heading_error_rad(run.truth[-1])) <= heading_rad:
        return None
    return cause_of(HeadingMissed(run, position_m, heading_rad))


@explanation(HeadingMissed)
def off_course(symptom: HeadingMissed) -> Cause | None:
    """The process ended, the robot touched something, or no command came for long."""
    return why_off_course(symptom.run.recording)


@explanation(HeadingMissed)
def heading_misread(symptom: HeadingMissed) -> Cause | None:
    """The yaw is computed wrongly from the quaternion."""
    misread = misread_yaw(symptom.run, symptom.position_m)
    return Cause(f"{symptom.seen}: {misread}", misread.hint, symptom.evidence) if misread else None


@explanation(HeadingMissed)
def turns_for_ever(symptom: HeadingMissed) -> Cause | None:
    """It still turns when the observation ends, perhaps always to one side."""
    if is_at_rest(symptom.last):
        return None
    circles = turns_one_way(symptom.run.truth)
    return Cause(
        f"{symptom.seen} and still turns at {turn(symptom.last.angular_rad_s)} when the "
        "observation ends" + (f": {_circling(circles)}" if circles else ""),
        f"{_YAW_HINT} {WRAP_HINT}"
        if circles
        else "angular.z is a gain times the goal's heading - yaw, both in radians and wrapped, and "
        "0 where that is within the tolerance: print all three while it turns.",
        symptom.evidence,
    )


@explanation(HeadingMissed)
def another_heading(symptom: HeadingMissed) -> Cause | None:
    """The goal's heading is taken for degrees, has the wrong sign, or is the opposite."""
    theta = symptom.run.goal.yaw_rad
    radians = "Angles in ROS are radians (REP-103), and so is the goal's heading already."
    headings = [
        (math.radians(theta), ": as if the goal's heading were taken for degrees", radians),
        (math.degrees(theta), ": as if the goal's heading were converted to degrees", radians),
        (
            -theta,
            ": that is the goal's heading with its sign changed",
            "Counter-clockwise is positive (REP-103): error = goal's heading - yaw.",
        ),
        (
            theta + math.pi,
            ": that is the opposite of the goal's heading",
            "Look at how you normalise the angle, and at the arguments of atan2(y, x).",
        ),
    ]
    near_rad = min(symptom.heading_rad, _AS_SENT_RAD)
    if abs(symptom.last.yaw_rad) <= near_rad and (
        abs(wrap_angle(headings[0][0])) <= symptom.heading_rad
    ):
        # So few degrees are left of a few radians that they cannot be told from 0.
        words = ": as if the goal's heading were 0, or were taken for degrees"
        hint = (
            f"{radians} Log the value that your node has read: that of a float parameter is "
            "parameter.value, or get_parameter_value().double_value."
        )
        headings[0] = (0.0, words, hint)
    for heading_rad, words, hint in headings:
        if symptom.looks_as(heading_rad):
            return Cause(f"{symptom.seen}{words}", hint, symptom.evidence)
    return None


@explanation(HeadingMissed)
def has_not_turned(symptom: HeadingMissed) -> Cause | None:
    """It has not turned since it arrived."""
    run = symptom.run
    driven = run.driven(math.inf)
    if driven is None or abs(turned_rad(run.truth[driven:])) >= symptom.heading_rad:
        return None
    return Cause(
        f"{symptom.seen}: it has not turned since it arrived",
        "Once the position is reached, angular.z is a gain times the goal's heading - yaw: is "
        "this part of the code reached, and which command does it publish?",
        symptom.evidence,
    )


@explanation(HeadingMissed)
def turned_past(symptom: HeadingMissed) -> Cause | None:
    """It turned too fast to stop at the goal's heading."""
    passing_rad_s = _turning_past_rad_s(symptom.run)
    if passing_rad_s is None:
        return None
    return Cause(
        f"{symptom.seen}: it still turned at {turn(passing_rad_s)} when it was there, and beyond "
        "it before it stood",
        "Your node sees it late, and the robot cannot stop at once. Make the angular gain "
        "smaller, or turn back where the error has become too large again.",
        symptom.evidence,
    )


@explanation(HeadingMissed, general=True)
def stopped_turning(symptom: HeadingMissed) -> Cause:
    """It stopped turning too early or too late."""
    return Cause(
        symptom.seen,
        "Turn on until abs(goal's heading - yaw) is within the tolerance, in radians and as they "
        "were given, and print yaw: it comes from the quaternion, and nothing is added to it.",
        symptom.evidence,
    )


def _circling(turns: float) -> str:
    side = "left" if turns > 0.0 else "right"
    return f"it turned {abs(turns):.1f} times around, always to the {side}"


def _turning_past_rad_s(run: Approach) -> float | None:
    """How fast it turned where it came by the goal's heading, just before it was told to stand.

    None for one that did not come by, or that was not told to stand because of that.
    """
    turning = [index for index, step in enumerate(run.truth) if step.command_rad_s]
    if not turning or turning[-1] == len(run.truth) - 1:
        return None
    told_ns = run.truth[turning[-1] + 1].time_ns
    late = [step for step in run.truth if step.time_ns >= told_ns - _SEEN_LATE_NS]
    for before, after in pairwise(late):
        error_rad = run.heading_error_rad(before)
        if abs(error_rad) < _A_LITTLE_RAD and error_rad * run.heading_error_rad(after) < 0.0:
            return after.angular_rad_s
    return None
