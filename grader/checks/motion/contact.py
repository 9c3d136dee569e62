"""The check of contact: the robot touches nothing."""

from __future__ import annotations

from pydantic import Field

from grader.checks.check import Subject, check
from grader.checks.finding import Evidence, Finding
from grader.checks.motion.robot_check import RobotParameters
from grader.diagnosis.motion.contact import why_touched
from grader.diagnosis.motion.no_motion import why_cut_short, why_not_judged, why_not_moved
from grader.diagnosis.no_node import why_no_node
from grader.measure.motion.quantities import metres
from grader.measure.motion.track import has_moved, speed_plot, way_m
from grader.recording.model import Recording


class NoContact(RobotParameters):
    """Parameters of motion.no_contact."""

    moving: bool = Field(
        True,
        description="Whether the robot must also have moved: a robot that always stands touches "
        "nothing.",
    )


@check("motion.no_contact", Subject.RECORDING, NoContact)
def no_contact(recording: Recording, parameters: NoContact) -> Finding:
    """The robot touches nothing.

    Judged by the simulator. Something that runs into a robot at rest does not count.
    A robot that never moved does not pass, unless `moving` is false.
    """
    expected = "touches nothing"
    touched = why_touched(recording)
    if touched is not None:
        cause = why_cut_short(recording)
        return (cause.after(touched.observed) if cause else touched).finding(expected)
    cause = why_not_moved(recording) if parameters.moving else why_not_judged(recording)
    if cause is None and not parameters.moving:
        cause = why_no_node(recording)
        if cause is None and not has_moved(recording.truth):
            cause = why_cut_short(recording)
    if cause is not None:
        return cause.finding(expected)
    evidence = Evidence(plots=(speed_plot(recording),))
    return Finding.passed(expected, f"no contact on {metres(way_m(recording.truth))}", evidence)
