"""The check of who is caught, and in which order."""

from __future__ import annotations

from dataclasses import replace
from enum import Enum
from itertools import takewhile

from pydantic import Field

from grader.checks.check import Subject, check, stop_if
from grader.checks.turtle.turtle_check import TurtleParameters, astray
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.turtle.astray import why_no_turtles
from grader.findings.finding import Evidence, Finding, evidence_at, moment, until_the_end
from grader.findings.words import code, codes, counted, metres
from grader.measure.turtle.hunt import Catch, Hunt
from grader.recording.model import Recording
from grader.spec.quantity import PositiveLength

_KILL = "/kill"
# Where the assignment does not say how near, this is near enough to have come for it.
_NEAR_M = 0.5
_MARGIN_M = 0.2
"""Of two that are nearly as near, either is the nearest."""


class Order(str, Enum):
    """In which order turtles are caught."""

    ANY = "any"
    LISTED = "listed"
    NEAREST = "nearest"


class Catches(TurtleParameters):
    """Parameters of turtle.catches."""

    prey: tuple[str, ...] = Field(min_length=1, description="Names of the turtles to catch.")
    within: PositiveLength | None = Field(
        None, description="How near `turtle` must be when one is killed; by default anywhere."
    )
    order: Order = Field(
        Order.ANY,
        description="`listed`: as in `prey`; `nearest`: always the one that is the nearest to "
        "`turtle` when the one before is killed.",
    )
    teleports: bool = Field(True, description="Whether `turtle` may be teleported.")

    def _asked(self) -> str:
        how = {Order.LISTED: " in this order", Order.NEAREST: ", always the nearest"}
        near = f", each within {metres(self.within)} of {code(self.turtle)}" if self.within else ""
        way = "" if self.teleports else f"; {code(self.turtle)} is not teleported"
        return f"{codes(self.prey)} are killed{how.get(self.order, '')}{near}{way}"


@check("turtle.catches", Subject.RECORDING, Catches)
def catches(recording: Recording, parameters: Catches) -> Finding:
    """Turtles are caught: killed when the hunter is near, in the order.

    Each that is caught rightly, before the first that is not, gives an equal share of the points.
    """
    stop_if(why_no_turtles(recording))
    jumps = [
        event
        for event in recording.turtles
        if event.kind == "teleported" and event.turtle == parameters.turtle
    ]
    if jumps and not parameters.teleports:
        shown = evidence_at(recording, "teleported", jumps[0].time_ns)
        return mistaken("turtle_teleported", f"{code(parameters.turtle)} was teleported", shown)
    hunt = Hunt(recording, parameters.turtle, parameters.prey)
    catches, prey = hunt.catches, parameters.prey
    evidence = _evidence(recording, catches)
    right = list(takewhile(lambda one: _is_right(*one, parameters), enumerate(catches)))
    credit = len(right) / len(prey)
    if len(right) < len(catches):
        number = len(right)
        return replace(_mistake(catches[number], number, parameters, evidence), credit=credit)
    if len(catches) < len(prey):
        return replace(_missing(hunt, parameters, evidence), credit=credit)
    return Finding.as_asked(f"{codes(one.name for one in catches)} in this order", evidence)


def _evidence(recording: Recording, caught: tuple[Catch, ...]) -> Evidence:
    return Evidence(tuple(moment(recording, f"{one.name} killed", one.time_ns) for one in caught))


def _is_right(number: int, one: Catch, asked: Catches) -> bool:
    if _is_far(one, asked):
        return False
    if asked.order is Order.LISTED:
        return one.name == asked.prey[number]
    return asked.order is Order.ANY or not _had_nearer(one)


def _is_far(one: Catch, asked: Catches) -> bool:
    return asked.within is not None and (one.distance_m is None or one.distance_m > asked.within)


def _had_nearer(one: Catch) -> bool:
    """Whether another turtle was nearer when the hunt for this one began."""
    if one.nearest is None or one.begin_m is None:
        return False
    return one.begin_m > one.nearest[1] + _MARGIN_M


def _mistake(one: Catch, number: int, asked: Catches, evidence: Evidence) -> Finding:
    name = code(one.name)
    if _is_far(one, asked):
        away = f"{metres(one.distance_m)} away" if one.distance_m is not None else "not there"
        seen = f"{name} was killed when {code(asked.turtle)} was {away}"
        return mistaken("turtle_from_afar", seen, evidence)
    if asked.order is Order.LISTED:
        seen = f"{name} was killed before {code(asked.prey[number])}"
        return mistaken("turtle_other_order", seen, evidence)
    assert one.nearest is not None and one.begin_m is not None
    other, away_m = one.nearest
    before = f"{code(other)}, {metres(away_m)} away"
    seen = f"{name}, {metres(one.begin_m)} away, was hunted before {before}"
    return mistaken("turtle_other_order", seen, evidence)


def _missing(hunt: Hunt, asked: Catches, evidence: Evidence) -> Finding:
    """Why some were not caught."""
    recording = hunt.recording
    evidence = replace(evidence, moments=(*evidence.moments, until_the_end(recording)))
    caught = {one.name for one in hunt.catches}
    left = [name for name in asked.prey if name not in caught]
    number = f"{len(caught)} of {counted(len(asked.prey), 'turtle')}"
    absent = [name for name in left if name not in hunt.ways]
    if absent:
        seen = f"{number} killed; {codes(absent)} never there"
        return mistaken("turtle_not_spawned", seen, evidence)
    end_ns = recording.truth[-1].time_ns
    seen = f"{number} killed; not {codes(left, 'or')}"
    requests = recording.asked_of(_KILL)
    if len(requests) > len(caught):
        named = code(requests[-1].fields["name"])
        times = counted(len(requests), "request")
        seen = f"{seen}, in {times} to {code(_KILL)}, the last with the name {named}"
        return mistaken("turtle_not_killed", seen, evidence)
    for name in left:
        away_m = hunt.distance_m(name, end_ns)
        if away_m is not None and away_m <= (asked.within or _NEAR_M):
            near = f"{seen}, although {code(asked.turtle)} was at {code(name)} at the end"
            return mistaken("turtle_not_killed", near, evidence)
    return astray(recording, seen, asked.turtle, evidence=evidence)
