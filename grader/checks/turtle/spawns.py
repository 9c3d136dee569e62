"""The check of turtles that are spawned."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from pydantic import Field

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.checks.need import WithTurtles
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.not_asked import why_not_asked
from grader.diagnosis.turtle.astray import why_no_turtles
from grader.findings.finding import Evidence, Finding, moment, until_the_end
from grader.findings.words import code, codes, counted, metres, point
from grader.recording.model import Recording
from grader.spec.quantity import PositiveLength
from sim.coordinates import Point

_SPAWN = "/spawn"


class Spawns(Parameters):
    """Parameters of turtle.spawns."""

    about = ("client",)
    needs = (WithTurtles(),)

    turtles: Mapping[str, Point] = Field(
        min_length=1, description="Name -> place `[x, y]`, from the lower left corner."
    )
    position: PositiveLength = Field(0.05, description="How near its place.")

    def _asked(self) -> str:
        return "spawns " + ", ".join(
            f"{code(name)} at {point(*place)}" for name, place in self.turtles.items()
        )


@check("turtle.spawns", Subject.RECORDING, Spawns)
def spawns(recording: Recording, parameters: Spawns) -> Finding:
    """Turtles are spawned with their names at their places.

    More than these may be there. Each gives an equal share of the points.
    """
    stop_if(why_no_turtles(recording))
    spawned = [event for event in recording.turtles if event.kind == "spawned"]
    shown = Evidence(
        tuple(moment(recording, f"{one.turtle} spawned", one.time_ns) for one in spawned)
    )
    shown = shown if spawned else Evidence((until_the_end(recording),))
    places = {one.turtle: (one.x_m, one.y_m) for one in reversed(spawned)}
    missing = [name for name in parameters.turtles if name not in places]
    off_m = {
        name: math.dist(place, places[name])
        for name, place in parameters.turtles.items()
        if name in places
    }
    wrong = [name for name, one in off_m.items() if one > parameters.position]
    credit = 1.0 - len(missing + wrong) / len(parameters.turtles)
    if missing:
        there = f": only {codes(places)}" if places else ""
        seen, asked = f"no {codes(missing, 'or')}{there}", recording.asked_of(_SPAWN)
        if len(asked) < len(parameters.turtles):
            found = why_not_asked(recording, _SPAWN, len(parameters.turtles)).after(seen)
        else:
            refused = {str(one.fields["name"]) for one in asked} - places.keys() - {""}
            seen += f"; not spawned: {codes(sorted(refused))}" if refused else ""
            found = mistaken("turtle_not_spawned", seen, shown)
    elif wrong:
        name = wrong[0]
        seen = f"{code(name)} was spawned at {point(*places[name])}, {metres(off_m[name])} off"
        found = mistaken("turtle_misplaced", seen, shown)
    else:
        return Finding.as_asked(counted(len(off_m), "turtle"), shown)
    return replace(found, credit=credit)
