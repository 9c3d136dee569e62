"""Why the robot does not look as it must at its goal."""

from __future__ import annotations

import math
from dataclasses import dataclass

from grader.diagnosis.explanation import Symptom, cause_of, explanation
from grader.diagnosis.mistake import remedy
from grader.diagnosis.motion.misread_yaw import misread_yaw
from grader.diagnosis.motion.off_course import why_off_course
from grader.findings.finding import Evidence, Finding
from grader.findings.first_seen import until_the_end
from grader.measure.motion.approach import Approach
from grader.measure.motion.quantities import degrees, turn
from grader.measure.motion.track import is_at_rest, turned_rad
from grader.recording.simulated import Truth


@dataclass(frozen=True)
class HeadingMissed(Symptom[Finding], concept="angles"):
    """The robot is at the goal with the wrong heading."""

    run: Approach
    position_m: float
    heading_rad: float

    @property
    def last(self) -> Truth:
        """The end of the way."""
        return self.run.truth[-1]

    def cause(self, words: str, hint: str) -> Finding:
        """The symptom in words, followed by more, with the heading over time."""
        plots = (self.run.heading_plot,)
        return Finding(
            f"is at the goal's position, but faces {degrees(self.last.yaw_rad)} instead of "
            f"{degrees(self.run.goal.yaw_rad)}{words}",
            hint,
            Evidence(moments=(until_the_end(self.run.recording),), plots=plots),
        )


def why_not_aligned(run: Approach, position_m: float, heading_rad: float) -> Finding | None:
    """Why the robot does not look as the goal does in the end; None if it does."""
    if abs(run.heading_error_rad(run.truth[-1])) <= heading_rad:
        return None
    return cause_of(HeadingMissed(run, position_m, heading_rad))


@explanation(HeadingMissed)
def off_course(symptom: HeadingMissed) -> Finding | None:
    """The process ended, the robot touched something, or no command came for a long time."""
    return why_off_course(symptom.run.recording)


@explanation(HeadingMissed)
def heading_misread(symptom: HeadingMissed) -> Finding | None:
    """The yaw is computed wrongly from the quaternion."""
    misread = misread_yaw(symptom.run, symptom.position_m)
    return symptom.cause(f": {misread}", remedy(misread.mistake)) if misread else None


@explanation(HeadingMissed, general=True)
def stopped_turning(symptom: HeadingMissed) -> Finding:
    """It stopped turning too early or too late, never turned to the heading, or still turns."""
    words, driven = "", symptom.run.driven(math.inf)
    if not is_at_rest(symptom.last):
        words = f" and still turns at {turn(symptom.last.angular_rad_s)} when the observation ends"
    elif driven is not None and abs(turned_rad(symptom.run.truth[driven:])) < symptom.heading_rad:
        words = ": it has not turned since it arrived"
    return symptom.cause(words, remedy("stopped_turning"))
