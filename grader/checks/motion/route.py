"""The check of a robot's route: the places that it visits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import dropwhile

from pydantic import Field

from grader.checks.check import Subject, check, stop_if
from grader.checks.motion.place import Place
from grader.checks.motion.robot_check import RobotParameters
from grader.diagnosis.explanation import cause_of, remedy
from grader.diagnosis.motion.missed_place import PlaceMissed
from grader.diagnosis.motion.no_motion import why_not_moved
from grader.diagnosis.motion.off_course import why_off_course
from grader.findings.finding import Evidence, Finding, Moment, moment
from grader.findings.words import counted, listing, metres
from grader.measure.motion.track import is_at_rest, speed_plot, way_m
from grader.recording.model import NS, Recording
from grader.recording.simulated import Truth
from grader.spec.quantity import Duration, PositiveLength
from grader.spec.unit import format_duration


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
        return f"visits {listing(map(str, self.places))}{order}{rest}"


@check("motion.visits", Subject.RECORDING, Visits)
def visits(recording: Recording, parameters: Visits) -> Finding:
    """The robot visits the places.

    Judged by the true position of its middle. With `ordered`, a place counts once those before it
    have been visited. Each place gives an equal share of the points.
    """
    stop_if(why_not_moved(recording))
    places, visited_ns = parameters.places, _visited_ns(recording.truth, parameters)
    moments = tuple(
        moment(recording, f"at {places[number]}", time_ns) for number, time_ns in visited_ns.items()
    )
    if len(visited_ns) == len(places):
        evidence = Evidence(moments, plots=(speed_plot(recording),))
        return Finding.as_asked(f"all of them on {metres(way_m(recording.truth))}", evidence)
    cause = _why_missed(recording, parameters, visited_ns, moments)
    return replace(cause, credit=len(visited_ns) / len(places))


def _visited_ns(truth: Sequence[Truth], parameters: Visits) -> dict[int, int]:
    """When the visit of each place was complete, by its index; without those never visited."""
    visited_ns: dict[int, int] = {}
    there_since_ns: dict[int, int] = {}
    pause_ns = round((parameters.pause or 0.0) * NS)
    for step in truth:
        for number, place in enumerate(parameters.places):
            if number in visited_ns:
                continue
            is_there = place.has(step, parameters.position)
            if not is_there or (pause_ns and not is_at_rest(step)):
                there_since_ns.pop(number, None)
            elif step.time_ns - there_since_ns.setdefault(number, step.time_ns) >= pause_ns:
                visited_ns[number] = step.time_ns
            # A later place does not count yet.
            if parameters.ordered and number not in visited_ns:
                break
    return visited_ns


def _why_missed(
    recording: Recording,
    parameters: Visits,
    visited_ns: Mapping[int, int],
    moments: tuple[Moment, ...],
) -> Finding:
    """Why the first place that is missing was not visited."""
    places = parameters.places
    number = next(index for index in range(len(places)) if index not in visited_ns)
    place = places[number]
    # Without an order it may have been on its way to any of the others.
    since_ns = max(visited_ns.values(), default=0) if parameters.ordered else 0
    way = tuple(step for step in recording.truth if step.time_ns >= since_ns)
    later = places[number + 1 :] if parameters.ordered else ()
    skipped_to = next((str(one) for one in later if _arrival(way, one, parameters)), "")
    symptom = PlaceMissed(
        recording,
        seen=f"{len(visited_ns)} of {counted(len(places), 'place')}",
        name=str(place),
        x_m=place.middle.x_m,
        y_m=place.middle.y_m,
        reach_m=place.reach_m(parameters.position),
        way=way,
        visited=moments,
        skipped_to=skipped_to,
    )
    if parameters.pause:
        arrival, mistake = _arrival(way, place, parameters), "short_pause"
        why_not_counted = f"at rest for less than {format_duration(parameters.pause)}"
    else:
        arrival, mistake = _arrival(recording.truth, place, parameters), "other_order"
        why_not_counted = "only before the places before it"
    if arrival is None:
        return cause_of(symptom)
    was_there = f"it was at {place}, {why_not_counted}"
    return why_off_course(recording) or symptom.cause(
        was_there, remedy(mistake), f"at {place}", arrival
    )


def _arrival(steps: Sequence[Truth], place: Place, parameters: Visits) -> Truth | None:
    """When the robot came to a place where it was not at first; None if it did not."""
    near_m = parameters.position
    away = dropwhile(lambda step: place.has(step, near_m), steps)
    return next((step for step in away if place.has(step, near_m)), None)
