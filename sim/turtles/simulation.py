"""All turtles on their canvas, step by step, without ROS and without a clock.

As turtlesim of Jazzy (turtlesim/src/turtle_frame.cpp of ros/ros_tutorials, 1.8.2). The same
turtles, requests and commands give the same steps, bit by bit.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import Enum

from sim.motion import Pose
from sim.turtles.bounds import CENTRE_M, Colour
from sim.turtles.canvas import Canvas
from sim.turtles.turtle import STEP_NS, Jump, Outcome, Pen, Rotation, Turtle, Velocity

FIRST = "turtle1"
_MIDDLE = Pose(CENTRE_M, CENTRE_M, 0.0)
MOST = 50
"""Turtles at the same time: each has ten topics and services."""


class Act(str, Enum):
    """Something that happens to turtles besides their motion."""

    PLACED = "placed"
    """It was there at the beginning, or is there again after a reset."""
    SPAWNED = "spawned"
    KILLED = "killed"
    PEN = "pen"
    TELEPORTED = "teleported"
    CLEARED = "cleared"
    RESET = "reset"
    COMMAND_REJECTED = "command_rejected"
    COMMAND_TIMEOUT = "command_timeout"


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened in a step, with the turtle's pose and pen after it."""

    act: Act
    turtle: str = ""
    pose: Pose | None = None
    pen: Pen | None = None


@dataclass(frozen=True, slots=True)
class State:
    """A turtle after a step."""

    pose: Pose
    velocity: Velocity
    hits_wall: bool
    colour: Colour


@dataclass(frozen=True, slots=True)
class Step:
    """The truth after a step.

    Attributes:
        time_ns: Simulated time at its end.
        events: What happened before its motion, in order.
        turtles: Name -> state, of all that are there.
    """

    time_ns: int
    events: tuple[Event, ...]
    turtles: dict[str, State]


class Turtles:
    """The stepping core. Requests act in the next step, in the order of their calls."""

    def __init__(self, placed: Iterable[tuple[str, Pose]] = ()) -> None:
        """Begin at simulated time 0 with some turtles, by default the one of turtlesim."""
        self.canvas = Canvas()
        self.turtles: dict[str, Turtle] = {}
        self._events: list[Event] = []
        self._steps = 0
        self._newest_number = 0
        for name, pose in placed or ((FIRST, _MIDDLE),):
            self._add(name, pose, Act.PLACED)

    @property
    def time_ns(self) -> int:
        """Simulated time."""
        return self._steps * STEP_NS

    def advance(self) -> Step:
        """Simulate one step of 16 ms."""
        states = {}
        for name, turtle in self.turtles.items():
            step = turtle.advance(self.canvas, self.time_ns)
            for pose in step.landings:
                self._events.append(Event(Act.TELEPORTED, name, pose, turtle.pen))
            if step.timed_out:
                self._note(Act.COMMAND_TIMEOUT, turtle)
            states[name] = State(turtle.pose, turtle.velocity, turtle.hits_wall, step.colour)
        events, self._events = tuple(self._events), []
        self._steps += 1
        return Step(self.time_ns, events, states)

    def command(self, name: str, velocity: Velocity) -> None:
        """Command a turtle for a second; NaN or infinity stops it instead."""
        turtle = self.turtles[name]
        if not velocity.is_finite:
            self._note(Act.COMMAND_REJECTED, turtle)
            velocity = Velocity()
        turtle.command(velocity, self.time_ns)

    def spawn(self, pose: Pose, name: str = "") -> str:
        """Add a turtle; returns its name, or nothing if it cannot be added."""
        if not name:
            name = self._next_name()
        if name in self.turtles or len(self.turtles) >= MOST or not _is_finite(pose):
            return ""
        self._add(name, pose, Act.SPAWNED)
        return name

    def kill(self, name: str) -> bool:
        """Take a turtle away; whether there was one of that name."""
        turtle = self.turtles.pop(name, None)
        if turtle is None:
            return False
        turtle.end_rotation(Outcome.ABORTED)
        self._note(Act.KILLED, turtle)
        return True

    def clear(self) -> None:
        """Take away all lines."""
        self.canvas.clear()
        self._events.append(Event(Act.CLEARED))

    def reset(self) -> None:
        """Take away all lines and turtles, and place the first one again."""
        self.canvas.clear()
        for turtle in self.turtles.values():
            turtle.end_rotation(Outcome.ABORTED)
        self.turtles.clear()
        self._newest_number = 0
        self._events.append(Event(Act.RESET))
        self._add(self._next_name(), _MIDDLE, Act.PLACED)

    def set_pen(self, name: str, pen: Pen) -> None:
        """Give a turtle another pen; one that is up keeps its colour and width."""
        turtle = self.turtles[name]
        turtle.pen = pen if pen.is_down else replace(turtle.pen, is_down=False)
        self._note(Act.PEN, turtle)

    def teleport(self, name: str, jump: Jump) -> None:
        """Teleport a turtle; its pen draws the line."""
        if _is_finite(jump.pose) and math.isfinite(jump.ahead_m or 0.0):
            self.turtles[name].jumps.append(jump)

    def rotate(self, name: str, theta_rad: float) -> Rotation | None:
        """Turn a turtle to a heading; None if that is no number."""
        return self.turtles[name].rotate(theta_rad) if math.isfinite(theta_rad) else None

    def _next_name(self) -> str:
        """The next of turtle1, turtle2 and so on that no turtle has."""
        name = ""
        while not name or name in self.turtles:
            self._newest_number += 1
            name = f"turtle{self._newest_number}"
        return name

    def _add(self, name: str, pose: Pose, act: Act) -> None:
        self.turtles[name] = Turtle(name, pose)
        self._note(act, self.turtles[name])

    def _note(self, act: Act, turtle: Turtle) -> None:
        self._events.append(Event(act, turtle.name, turtle.pose, turtle.pen))


def _is_finite(pose: Pose) -> bool:
    return all(map(math.isfinite, (pose.x_m, pose.y_m, pose.yaw_rad)))
