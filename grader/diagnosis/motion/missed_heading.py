"""Why the robot does not look as it must at its goal."""

from __future__ import annotations

import math
from dataclasses import dataclass

from grader.diagnosis.cause import Cause
from grader.diagnosis.explanation import Symptom, cause_of, explanation
from grader.diagnosis.motion.misread_yaw import misread_yaw
from grader.diagnosis.motion.off_course import why_off_course
from grader.findings.finding import Evidence
from grader.findings.first_seen import until_the_end
from grader.measure.motion.approach import Approach
from grader.measure.motion.quantities import degrees, turn
from grader.measure.motion.track import is_at_rest, turned_rad
from grader.recording.simulated import Truth
from sim.motion import wrap_angle

# How far from the heading that it was sent to a robot rests: the default of angle_tolerance.
_AS_SENT_RAD = 0.06


@dataclass(frozen=True)
class HeadingMissed(Symptom[Cause], concept="angles"):
    """The robot is at the goal with the wrong heading."""

    run: Approach
    position_m: float
    heading_rad: float

    @property
    def last(self) -> Truth:
        """The end of the way."""
        return self.run.truth[-1]

    def cause(self, words: str, hint: str) -> Cause:
        """The symptom in words, followed by more, with the heading over time."""
        plots = (self.run.heading_plot,)
        return Cause(
            f"is at the goal's position, but faces {degrees(self.last.yaw_rad)} instead of "
            f"{degrees(self.run.goal.yaw_rad)}{words}",
            hint,
            Evidence(moments=(until_the_end(self.run.recording),), plots=plots),
        )


def why_not_aligned(run: Approach, position_m: float, heading_rad: float) -> Cause | None:
    """Why the robot does not look as the goal does in the end; None if it does."""
    if abs(run.heading_error_rad(run.truth[-1])) <= heading_rad:
        return None
    return cause_of(HeadingMissed(run, position_m, heading_rad))


@explanation(HeadingMissed)
def off_course(symptom: HeadingMissed) -> Cause | None:
    """The process ended, the robot touched something, or no command came for a long time."""
    return why_off_course(symptom.run.recording)


@explanation(HeadingMissed)
def heading_misread(symptom: HeadingMissed) -> Cause | None:
    """The yaw is computed wrongly from the quaternion."""
    misread = misread_yaw(symptom.run, symptom.position_m)
    return symptom.cause(f": {misread}", misread.hint) if misread else None


@explanation(HeadingMissed)
def turns_for_ever(symptom: HeadingMissed) -> Cause | None:
    """It still turns at the end of the observation."""
    if is_at_rest(symptom.last):
        return None
    return symptom.cause(
        f" and still turns at {turn(symptom.last.angular_rad_s)} when the observation ends",
        "angular.z = gain * (goal's heading - yaw), in radians, normalised to [-pi, pi], and 0.0 "
        "within the tolerance. Print the goal's heading, yaw and angular.z while it turns.",
    )


@explanation(HeadingMissed)
def another_heading(symptom: HeadingMissed) -> Cause | None:
    """The goal's heading is read as degrees or as 0, or has the wrong sign."""
    goal_rad = symptom.run.goal.yaw_rad
    headings = (
        (
            math.radians(goal_rad),
            "as if the goal's heading were 0, or were in degrees",
            "The goal's heading is in radians already (REP-103): do not convert it. Log the value "
            "that your node has read. A float parameter's value is "
            "get_parameter_value().double_value.",
        ),
        (
            -goal_rad,
            "that is the goal's heading with the wrong sign",
            "Counter-clockwise is positive (REP-103): error = goal's heading - yaw.",
        ),
    )
    near_rad = min(symptom.heading_rad, _AS_SENT_RAD)
    for heading_rad, words, hint in headings:
        is_another = abs(wrap_angle(heading_rad - goal_rad)) > 2.0 * symptom.heading_rad
        if is_another and abs(wrap_angle(heading_rad - symptom.last.yaw_rad)) <= near_rad:
            return symptom.cause(f": {words}", hint)
    return None


@explanation(HeadingMissed)
def has_not_turned(symptom: HeadingMissed) -> Cause | None:
    """It has not turned since it arrived."""
    run = symptom.run
    driven = run.driven(math.inf)
    if driven is None or abs(turned_rad(run.truth[driven:])) >= symptom.heading_rad:
        return None
    return symptom.cause(
        ": it has not turned since it arrived",
        "At the goal's position, angular.z = gain * (goal's heading - yaw). Is this part of the "
        "code reached? Which command does it publish?",
    )


@explanation(HeadingMissed, general=True)
def stopped_turning(symptom: HeadingMissed) -> Cause:
    """It stopped turning too early or too late."""
    return symptom.cause(
        "",
        "Turn until abs(goal's heading - yaw) is below the tolerance, both in radians. Print yaw: "
        "compute it from the quaternion, and add nothing to it. If the robot turns past the "
        "heading, make the angular gain smaller.",
    )
