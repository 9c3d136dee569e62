"""The check of driving straight ahead."""

from __future__ import annotations

from pydantic import Field

from grader.checks.check import Subject, check
from grader.checks.finding import Evidence, Finding, Moment
from grader.checks.motion.robot_check import RobotParameters
from grader.checks.wording import percent
from grader.diagnosis.motion.no_motion import why_not_moved
from grader.measure.motion.quantities import degrees, turn
from grader.measure.motion.track import headings, over_time
from grader.recording.model import Recording
from grader.spec.quantity import Angle, AngularSpeed


class Straight(RobotParameters):
    """Parameters of motion.straight."""

    tolerance: AngularSpeed = Field(
        0.01, description="Largest angular.z that still counts as zero, either way."
    )
    heading: Angle = Field(
        0.035, description="How far the heading may be off that of the start, either way."
    )


@check("motion.straight", Subject.RECORDING, Straight)
def straight(recording: Recording, parameters: Straight) -> Finding:
    """The robot drives straight ahead.

    Judged by the commands in force and by the true heading: `angular.z` is zero all the time,
    and the heading stays that of the start.
    """
    expected = f"drives straight: angular.z is zero (within {turn(parameters.tolerance)})"
    cause = why_not_moved(recording)
    if cause is not None:
        return cause.finding(expected)
    truth = recording.truth
    evidence = Evidence(
        plots=(
            over_time(
                recording,
                "Commanded turn",
                "angular.z (rad/s)",
                lambda step: step.command_rad_s,
                (-parameters.tolerance, parameters.tolerance),
            ),
        )
    )
    turning = [step for step in truth if abs(step.command_rad_s) > parameters.tolerance]
    if turning:
        first = turning[0]
        worst = max(turning, key=lambda step: abs(step.command_rad_s))
        when_s = recording.since_launch_s(first.time_ns)
        still = all(step.command_m_s == 0.0 for step in turning)
        words = f"angular.z = {turn(worst.command_rad_s)} was commanded"
        words += ", and linear.x = 0 with it" if still else ""
        return Finding.failed(
            expected,
            f"{words} (from {when_s:.2f} s after launch, {percent(len(turning) / len(truth))} of "
            "the time)",
            "The speed ahead is linear.x, the turn is angular.z: leave angular.z at 0.0.",
            Evidence(moments=(Moment("first turn commanded", when_s),), plots=evidence.plots),
        )
    start_rad = truth[0].yaw_rad
    off_rad = max((heading - start_rad for heading in headings(truth)), key=abs)
    if abs(off_rad) > parameters.heading:
        return Finding.failed(
            expected,
            f"the heading changed by {degrees(off_rad)}, through commands of less than "
            f"{turn(parameters.tolerance)} that add up",
            "Leave angular.z at exactly 0.0.",
            Evidence(moments=(_too_far(recording, parameters.heading),), plots=evidence.plots),
        )
    return Finding.passed(expected, f"heading within {degrees(off_rad)} of the start", evidence)


def _too_far(recording: Recording, limit_rad: float) -> Moment:
    """When the heading was first farther from the start than allowed."""
    truth = recording.truth
    turned = zip(headings(truth), truth, strict=True)
    start_rad = truth[0].yaw_rad
    off = next(step for heading, step in turned if abs(heading - start_rad) > limit_rad)
    return Moment("the heading is too far off", recording.since_launch_s(off.time_ns))
