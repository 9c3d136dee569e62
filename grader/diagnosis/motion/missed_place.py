"""Why a robot did not come to a place on its route."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from grader.diagnosis.explanation import Symptom, explanation, remedy
from grader.diagnosis.motion.off_course import why_off_course
from grader.findings.finding import Evidence, Finding, Moment, moment
from grader.findings.words import degrees, metres
from grader.measure.motion.track import final_rest, speed_plot
from grader.recording.model import Recording
from grader.recording.simulated import Truth
from sim.motion import wrap_angle

# A shorter way has no direction.
_WAY_M = 0.1
# Less than this is no turn: a robot drifts by some degrees.
_TURN_RAD = math.radians(15.0)


@dataclass(frozen=True)
class PlaceMissed(Symptom[Finding]):
    """The robot did not come to a place on its route.

    Attributes:
        seen: How many places it has visited, in words.
        name: The place in words; ``x_m`` and ``y_m`` are its middle.
        reach_m: How near its middle the robot had to come.
        way: From the place before, or the start, to the end.
        visited: When it was at the places before.
        skipped_to: The place after this one at which it was first, in words, or nothing.
    """

    recording: Recording
    seen: str
    name: str
    x_m: float
    y_m: float
    reach_m: float
    way: tuple[Truth, ...]
    visited: tuple[Moment, ...]
    skipped_to: str = ""

    def distance_m(self, step: Truth) -> float:
        """How far the robot is from the place."""
        return math.hypot(self.x_m - step.x_m, self.y_m - step.y_m)

    @cached_property
    def nearest(self) -> Truth:
        """Where the robot was nearest to the place."""
        return min(self.way, key=self.distance_m)

    @cached_property
    def gone_m(self) -> list[float]:
        """How far each step is from the beginning of the way."""
        first = self.way[0]
        return [math.hypot(step.x_m - first.x_m, step.y_m - first.y_m) for step in self.way]

    def first_beyond(self, gone_m: float) -> Truth:
        """The first step that is so far from the beginning of the way."""
        steps = zip(self.way, self.gone_m, strict=True)
        return next(step for step, step_gone_m in steps if step_gone_m >= gone_m)

    def bearing_rad(self, x_m: float, y_m: float) -> float:
        """The direction of a point as the robot looks at the beginning, counter-clockwise."""
        first = self.way[0]
        return wrap_angle(math.atan2(y_m - first.y_m, x_m - first.x_m) - first.yaw_rad)

    def cause(self, words: str, hint: str, label: str, step: Truth) -> Finding:
        """What it did instead, and when."""
        moments = (*self.visited, moment(self.recording, label, step.time_ns))
        evidence = Evidence(moments, plots=(speed_plot(self.recording),))
        return Finding(f"{self.seen}; {words}", hint, evidence)


def _to(angle_rad: float) -> str:
    return f"{degrees(abs(angle_rad))} to the {'left' if angle_rad > 0.0 else 'right'}"


@explanation(PlaceMissed)
def off_course(symptom: PlaceMissed) -> Finding | None:
    """The process ended, the robot touched something, or no command came for a long time."""
    return why_off_course(symptom.recording)


@explanation(PlaceMissed)
def skipped(symptom: PlaceMissed) -> Finding | None:
    """It went to a later place without this one."""
    if not symptom.skipped_to:
        return None
    return symptom.cause(
        f"it went to {symptom.skipped_to} without {symptom.name} before",
        remedy("skipped"),
        f"nearest to {symptom.name}",
        symptom.nearest,
    )


@explanation(PlaceMissed, concept="angles")
def turned_wrongly(symptom: PlaceMissed) -> Finding | None:
    """It turned to the wrong side, too far or too little, and drove off."""
    distance_m = symptom.distance_m(symptom.way[0])
    far_m = min(max(symptom.gone_m), distance_m)
    # The direction in which it drove is seen best where it should have been at the place.
    far = symptom.first_beyond(far_m)
    turned_rad = symptom.bearing_rad(far.x_m, far.y_m)
    needed_rad = symptom.bearing_rad(symptom.x_m, symptom.y_m)
    room_rad = max(_TURN_RAD, math.atan2(symptom.reach_m, distance_m))
    if far_m < _WAY_M or abs(wrap_angle(turned_rad - needed_rad)) <= room_rad:
        return None
    off = symptom.first_beyond(_WAY_M)
    # It went in the right direction, and turned before it was there.
    if abs(wrap_angle(symptom.bearing_rad(off.x_m, off.y_m) - needed_rad)) <= _TURN_RAD:
        return None
    are_turns = min(abs(turned_rad), abs(needed_rad)) > _TURN_RAD
    if are_turns and turned_rad * needed_rad < 0.0:
        how, mistake = "to the wrong side", "other_side"
    else:
        how = "too far" if abs(turned_rad) > abs(needed_rad) else "too little"
        mistake = "other_turn"
    instead = _to(needed_rad) if abs(needed_rad) > _TURN_RAD else "straight ahead"
    return symptom.cause(
        f"on its way to {symptom.name} it turned {how}: {_to(turned_rad)} instead of {instead}",
        remedy(mistake),
        "drives off in another direction",
        off,
    )


@explanation(PlaceMissed)
def stopped_short(symptom: PlaceMissed) -> Finding | None:
    """It came to rest on its way to the place."""
    rest = final_rest(symptom.way)
    left_m = symptom.distance_m(symptom.way[-1])
    went_past = max(symptom.gone_m) > symptom.distance_m(symptom.way[0])
    if rest is None or went_past or left_m > symptom.distance_m(symptom.nearest) + symptom.reach_m:
        return None
    return symptom.cause(
        f"it stopped {metres(left_m)} from {symptom.name}",
        remedy("stopped_short"),
        f"stopped before {symptom.name}",
        symptom.way[rest],
    )


@explanation(PlaceMissed, general=True)
def not_near(symptom: PlaceMissed) -> Finding:
    """It came near the place, but not near enough."""
    return symptom.cause(
        f"it came within {metres(symptom.distance_m(symptom.nearest))} of {symptom.name}",
        remedy("not_near"),
        f"nearest to {symptom.name}",
        symptom.nearest,
    )
