"""Why a turtle went another way than was asked for, or none: one cause, the deepest."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

from grader.diagnosis.explanation import explanation, mistaken
from grader.diagnosis.no_messages import why_silent
from grader.diagnosis.no_node import why_no_node
from grader.diagnosis.process.not_called import at_its_place
from grader.diagnosis.process.process_exit import NotDone, process_ended
from grader.diagnosis.process.standing import stuck
from grader.findings.finding import Evidence, Finding, moment
from grader.findings.words import code, counted
from grader.measure.motion.command import VelocityCommand, number
from grader.recording.model import NS, Recording
from grader.recording.simulated import Truth
from sim.motion import REST, Twist

_DEGREES_RAD_S = 25.0
"""Faster than four turns in a second: the number is probably meant in degrees."""
_DEGREES_RAD = 6.5
"""More than a full turn."""
_TURNS = 2.0
"""So many full turns on one spot are no way to a heading."""
_SPOT_M = 0.1
"""A turtle that stays within this turns on the spot."""


def why_no_turtles(recording: Recording) -> Finding | None:
    """Why there is nothing to judge at all; None if there is."""
    if recording.turtles:
        return None
    missing = why_no_node(recording)
    if missing is not None:
        return missing
    if recording.matched_ns is None:
        return why_silent(recording, "/turtle1/cmd_vel")
    return Finding.ours("there are no turtles in this scenario: its `world` needs `turtles`")


@dataclass(frozen=True)
class TurtleAstray(NotDone):
    """A turtle did not go where it should.

    Attributes:
        what: What was seen, in words.
        turtle: Its name.
        shown: What the check shows for it.
    """

    what: str
    turtle: str
    shown: Evidence

    @property
    def seen(self) -> str:
        """The symptom in words."""
        return self.what

    @property
    def topic(self) -> str:
        """Of its commands."""
        return f"/{self.turtle}/cmd_vel"

    @cached_property
    def way(self) -> tuple[Truth, ...]:
        """Its truth."""
        return tuple(step for step in self.recording.truth if step.robot == self.turtle)

    @cached_property
    def sent(self) -> tuple[VelocityCommand, ...]:
        """Its commands."""
        return tuple(_commands(self.recording, self.topic))

    @cached_property
    def jumps(self) -> tuple[float, ...]:
        """Headings of its teleports."""
        events = [event for event in self.recording.turtles if event.turtle == self.turtle]
        return tuple(event.yaw_rad for event in events if event.kind == "teleported")

    def cause(self, name: str, words: str, time_ns: int | None = None, **values: object) -> Finding:
        """What it did instead, and when."""
        evidence = self.shown
        if time_ns is not None:
            moments = (moment(self.recording, words, time_ns), *evidence.moments)
            evidence = Evidence(moments=moments, plots=evidence.plots)
        return mistaken(name, f"{self.what}; {words}", evidence, **values)


def _commands(recording: Recording, topic: str) -> Iterator[VelocityCommand]:
    for message in recording.on(topic):
        linear = number(message.value, "linear", "x")
        angular = number(message.value, "angular", "z")
        if linear is not None and angular is not None:
            yield VelocityCommand(message.stamp_ns, Twist(linear, angular))


@explanation(TurtleAstray, after=(process_ended,))
def never_commanded(symptom: TurtleAstray) -> Finding | None:
    """Nothing was published on the topic of its commands, and it was not teleported."""
    if symptom.sent or symptom.jumps:
        return None
    return why_silent(symptom.recording, symptom.topic).after(symptom.what)


@explanation(TurtleAstray, concept="executors")
def callback_hangs(symptom: TurtleAstray) -> Finding | None:
    """A callback does not return until the end, and commands nothing more."""
    stand = stuck(symptom.recording)
    if stand is None or stand.lasted_s is None:
        return None
    since_ns = symptom.recording.stop_ns - stand.lasted_s * NS
    if any(one.time_ns > since_ns for one in symptom.sent):
        return None
    return at_its_place(Finding(symptom.what, "", symptom.shown), symptom.what, stand)


@explanation(TurtleAstray)
def angle_in_degrees(symptom: TurtleAstray) -> Finding | None:
    """An angle is given in degrees."""
    for command in symptom.sent:
        rate = f"{command.twist.angular_rad_s:g}"
        if abs(command.twist.angular_rad_s) > _DEGREES_RAD_S:
            words = f"angular.z was {rate} rad/s"
            return symptom.cause("turtle_degrees", words, command.time_ns, value=rate)
    for heading_rad in symptom.jumps:
        if abs(heading_rad) > _DEGREES_RAD:
            words = f"it was teleported to a heading of {heading_rad:g} rad"
            return symptom.cause("turtle_degrees", words, value=f"{heading_rad:g}")
    return None


@explanation(TurtleAstray)
def command_ran_out(symptom: TurtleAstray) -> Finding | None:
    """A command was published once, and turtles stop after a second."""
    incidents = [one for one in symptom.recording.incidents if one.robot == symptom.turtle]
    timeouts = [incident for incident in incidents if incident.kind == "command_timeout"]
    to_move = [command for command in symptom.sent if command.twist != REST]
    if not timeouts or len(timeouts) < len(to_move):
        return None
    times = counted(len(timeouts), "time")
    words = f"it stopped by itself {times}, 1 s after a command on {code(symptom.topic)}"
    return symptom.cause("turtle_ran_out", words, timeouts[0].time_ns)


@explanation(TurtleAstray)
def hit_the_wall(symptom: TurtleAstray) -> Finding | None:
    """It ran into a wall."""
    hit = next((step for step in symptom.way if step.contact), None)
    if hit is None:
        return None
    return symptom.cause("turtle_wall", "it ran into a wall", hit.time_ns)


@explanation(TurtleAstray)
def turns_for_ever(symptom: TurtleAstray) -> Finding | None:
    """It turns round and round on the spot: the difference of two headings is not wrapped."""
    turned_rad, spot = 0.0, next(iter(symptom.way), None)
    for before, step in pairwise(symptom.way):
        if spot is None or math.dist((step.x_m, step.y_m), (spot.x_m, spot.y_m)) > _SPOT_M:
            turned_rad, spot = 0.0, step
        turned_rad += math.remainder(step.yaw_rad - before.yaw_rad, math.tau)
        if abs(turned_rad) > _TURNS * math.tau:
            words = f"it turned more than {_TURNS:g} times round on the spot"
            return symptom.cause("turtle_spins", words, spot.time_ns)
    return None
