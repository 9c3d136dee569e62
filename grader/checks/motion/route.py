"""Checks of the way that a robot takes: places that it visits, the distance that it keeps."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import dropwhile
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from grader.checks.check import Subject, check, stop_if
from grader.checks.motion.robot_check import RobotParameters, moved_in
from grader.checks.need import OfSimulator, SimulatedRobot
from grader.diagnosis.explanation import cause_of, mistaken, remedy
from grader.diagnosis.motion.missed_place import PlaceMissed
from grader.diagnosis.motion.no_motion import why_not_moved
from grader.diagnosis.motion.off_course import why_off_course
from grader.findings.finding import Evidence, Finding, Moment, evidence_at, moment
from grader.findings.words import counted, listing, metres, percent, point
from grader.measure.motion.ground import nearest
from grader.measure.motion.track import is_at_rest, over_time, speed_plot, way_m
from grader.recording.model import NS, Recording
from grader.recording.simulated import Scene, Truth
from grader.spec.quantity import Duration, Length, PositiveLength, Ratio
from grader.spec.unit import format_duration
from sim.coordinates import Metres

# A step lasts for 10 ms.
_STRIDE = 5


def _point_or_zone(numbers: tuple[float, ...]) -> tuple[float, ...]:
    if len(numbers) not in (2, 4):
        raise ValueError("write a point as [x, y], a zone as [x_min, y_min, x_max, y_max]")
    return numbers


Place = Annotated[tuple[Metres, ...], AfterValidator(_point_or_zone)]


class Visits(RobotParameters):
    """Parameters of motion.visits."""

    places: tuple[Place, ...] = Field(
        min_length=1,
        description="Points `[x, y]` or zones `[x_min, y_min, x_max, y_max]` in the world's frame.",
    )
    position: PositiveLength = Field(0.1, description="How near a point counts as visited.")
    ordered: bool = Field(True, description="Whether the order of the places matters.")
    pause: Duration | None = Field(
        None, description="Least time at rest at each place; by default it may drive through."
    )

    def _asked(self) -> str:
        rest = f", at rest for {format_duration(self.pause)} at each" if self.pause else ""
        order = " in this order" if self.ordered and len(self.places) > 1 else ""
        return f"visits {listing(map(_words, self.places))}{order}{rest}"

    def is_at(self, place: Sequence[float], step: Truth) -> bool:
        """Whether the robot is at a place."""
        if len(place) == 2:
            return math.hypot(step.x_m - place[0], step.y_m - place[1]) <= self.position
        x_min, y_min, x_max, y_max = place
        return x_min <= step.x_m <= x_max and y_min <= step.y_m <= y_max


def _words(place: Sequence[float]) -> str:
    if len(place) == 2:
        return point(*place)
    x_min, y_min, x_max, y_max = place
    return f"the zone from {point(x_min, y_min)} to {point(x_max, y_max)}"


@check("motion.visits", Subject.RECORDING, Visits)
def visits(recording: Recording, parameters: Visits) -> Finding:
    """The robot visits the places.

    Judged by the true position of its middle. With `ordered`, a place counts once those before it
    have been visited. Each place gives an equal share of the points.
    """
    stop_if(why_not_moved(recording))
    moments = _visits(recording.truth, parameters)
    plots = (speed_plot(recording),)
    evidence = Evidence(
        moments=tuple(
            moment(recording, f"at {_words(parameters.places[number])}", time_ns)
            for number, time_ns in moments.items()
        ),
        plots=plots,
    )
    missed = [place for number, place in enumerate(parameters.places) if number not in moments]
    if not missed:
        return Finding.as_asked(f"all of them on {metres(way_m(recording.truth))}", evidence)
    cause = _why_missed(recording, parameters, moments, evidence.moments)
    credit = len(moments) / len(parameters.places)
    return replace(cause, credit=credit)


def _why_missed(
    recording: Recording,
    parameters: Visits,
    visited: dict[int, int],
    moments: tuple[Moment, ...],
) -> Finding:
    """Why the first place that is missing was not visited."""
    truth, places = recording.truth, parameters.places
    number = next(index for index in range(len(places)) if index not in visited)
    # Without an order it may have been on its way to any of the others.
    since_ns = max(visited.values(), default=0) if parameters.ordered else 0
    way = tuple(step for step in truth if step.time_ns >= since_ns)
    place, name = places[number], _words(places[number])
    x_m, y_m, reach_m = _middle(place, parameters.position)
    seen = f"{len(visited)} of {counted(len(places), 'place')}"
    there = _arrival(way if parameters.pause else truth, place, parameters)
    later = places[number + 1 :] if parameters.ordered else ()
    skipped = next((_words(one) for one in later if _arrival(way, one, parameters)), "")
    symptom = PlaceMissed(recording, seen, name, x_m, y_m, reach_m, way, moments, skipped)
    if there is None:
        return cause_of(symptom)
    short = f"at rest for less than {format_duration(parameters.pause or 0.0)}"
    how = short if parameters.pause else "only before the places before it"
    mistake = "short_pause" if parameters.pause else "other_order"
    seen, label = f"it was at {name}, {how}", f"at {name}"
    told = symptom.cause(seen, remedy(mistake), label, there)
    return why_off_course(recording) or told


def _arrival(steps: Sequence[Truth], place: Place, parameters: Visits) -> Truth | None:
    """When the robot came to a place where it was not at first; None if it did not."""
    away = dropwhile(lambda step: parameters.is_at(place, step), steps)
    return next((step for step in away if parameters.is_at(place, step)), None)


def _visits(truth: Sequence[Truth], parameters: Visits) -> dict[int, int]:
    """Number of each visited place -> when the visit was complete."""
    found: dict[int, int] = {}
    since: dict[int, int] = {}
    pause_ns = round((parameters.pause or 0.0) * NS)
    for step in truth:
        for number, place in enumerate(parameters.places):
            if number in found:
                continue
            counts = parameters.is_at(place, step) and (not pause_ns or is_at_rest(step))
            if not counts:
                since.pop(number, None)
            elif step.time_ns - since.setdefault(number, step.time_ns) >= pause_ns:
                found[number] = step.time_ns
            if parameters.ordered and number not in found:
                break
    return found


def _middle(place: Sequence[float], position_m: float) -> tuple[float, float, float]:
    """The middle of a place, and how near it the robot has to come."""
    if len(place) == 2:
        return place[0], place[1], position_m
    x_min, y_min, x_max, y_max = place
    reach_m = min(x_max - x_min, y_max - y_min) / 2.0
    return (x_min + x_max) / 2.0, (y_min + y_max) / 2.0, reach_m


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
    truth = recording.truth[::_STRIDE]
    kept = [_is_right(scene, step, parameters) for step in truth]
    band = (
        parameters.distance - parameters.tolerance,
        parameters.distance + parameters.tolerance,
    )
    plot = over_time(
        recording, "Distance to the nearest obstacle", "distance (m)", _distance(scene), band
    )
    begin = next((index for index, is_right in enumerate(kept) if is_right), None)
    if begin is None:
        shown = evidence_at(recording, "the run began", truth[0].time_ns, plot)
        distances = [sight.distance_m for step in truth if (sight := nearest(scene, step))]
        seen = "it never was at this distance"
        if distances:
            seen += f", but from {metres(min(distances))} to {metres(max(distances))} away"
        return why_off_course(recording) or mistaken("never_at_distance", seen, shown)
    end_s = recording.since_launch_s(truth[-1].time_ns)
    plot = replace(plot, judged=(recording.since_launch_s(truth[begin].time_ns), end_s))
    steps = list(zip(truth[begin:], truth[begin + 1 :], kept[begin + 1 :], strict=False))
    whole_m = sum(way_m((a, b)) for a, b, _ in steps)
    right_m = sum(way_m((a, b)) for a, b, is_right in steps if is_right)
    ratio = right_m / whole_m if whole_m else 0.0
    since = f"the {metres(whole_m)} since it first was"
    seen = f"at this distance for {metres(right_m)} of {since} ({percent(round(ratio, 2))})"
    evidence = evidence_at(recording, "first at this distance", truth[begin].time_ns, plot)
    if right_m >= parameters.way and ratio >= parameters.share:
        return Finding.as_asked(seen, evidence)
    return why_off_course(recording) or mistaken("other_distance", seen, evidence)


def _distance(scene: Scene) -> Callable[[Truth], float | None]:
    def distance_m(step: Truth) -> float | None:
        sight = nearest(scene, step)
        return None if sight is None else sight.distance_m

    return distance_m


def _is_right(scene: Scene, step: Truth, parameters: KeepsDistance) -> bool:
    sight = nearest(scene, step)
    if sight is None or abs(sight.distance_m - parameters.distance) > parameters.tolerance:
        return False
    side = "left" if sight.bearing_rad > 0.0 else "right"
    return parameters.side in ("any", side)
