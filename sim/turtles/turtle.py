"""One turtle: how it moves, step by step, and its pen. Pure.

As turtlesim of Jazzy (turtlesim/src/turtle.cpp of ros/ros_tutorials, 1.8.2), but for numbers that
are not finite: there they would spoil the pose for ever, here they are refused.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from enum import Enum

from sim.motion import NS, Pose
from sim.turtles.bounds import SIZE_M, Colour
from sim.turtles.canvas import Canvas

STEP_NS = 16_000_000
"""Length of a step: turtlesim's timer."""
_STEP_S = STEP_NS / NS
_COMMAND_NS = NS
"""How long a command acts."""
_TURN_RAD_S = 1.0
_ARRIVED_RAD = 0.02
_LARGEST = 1e30
"""A message holds float32, which end at 3.4e38."""


@dataclass(frozen=True, slots=True)
class Velocity:
    """What a turtle is commanded, in its own frame; counter-clockwise is positive."""

    ahead_m_s: float = 0.0
    left_m_s: float = 0.0
    turn_rad_s: float = 0.0

    @property
    def speed_m_s(self) -> float:
        """How fast it moves; never negative, as in the message of turtlesim."""
        return math.hypot(self.ahead_m_s, self.left_m_s)

    @property
    def is_finite(self) -> bool:
        """Whether no part is NaN, infinite, or too large for a float32."""
        return all(
            abs(part) < _LARGEST for part in (self.ahead_m_s, self.left_m_s, self.turn_rad_s)
        )


REST = Velocity()


@dataclass(frozen=True, slots=True)
class Pen:
    """What a turtle draws with.

    Attributes:
        colour: Red, green and blue, each from 0 to 255.
        width: Of its lines, in pixels; 45 pixels are 1 m.
        is_down: Whether it draws.
    """

    colour: Colour = (179, 184, 255)
    width: int = 3
    is_down: bool = True


@dataclass(frozen=True, slots=True)
class Jump:
    """A teleport.

    Attributes:
        pose: Where it ends; if ``ahead_m`` is given only the heading counts, as a turn.
        ahead_m: How far it leads from where the turtle is, after the turn.
    """

    pose: Pose
    ahead_m: float | None = None

    def landing(self, pose: Pose) -> Pose:
        """Where it ends for a turtle at a pose."""
        if self.ahead_m is None:
            return replace(self.pose, y_m=min(self.pose.y_m, SIZE_M))
        yaw_rad = pose.yaw_rad + self.pose.yaw_rad
        x_m = pose.x_m + self.ahead_m * math.cos(yaw_rad)
        return Pose(x_m, pose.y_m + self.ahead_m * math.sin(yaw_rad), yaw_rad)


class Outcome(str, Enum):
    """How a rotation ended."""

    SUCCEEDED = "succeeded"
    ABORTED = "aborted"
    CANCELED = "canceled"


@dataclass
class Rotation:
    """A goal of the action rotate_absolute.

    Attributes:
        theta_rad: The heading to turn to.
        remaining_rad: How far it still is.
        delta_rad: How far the turtle had turned, backwards, as turtlesim counts.
        outcome: None while the turtle turns.
    """

    theta_rad: float
    start_rad: float
    remaining_rad: float = 0.0
    delta_rad: float = 0.0
    is_canceling: bool = False
    outcome: Outcome | None = None


@dataclass(frozen=True, slots=True)
class TurtleStep:
    """What happened to a turtle in a step, besides its motion.

    Attributes:
        landings: Where it was teleported to.
        timed_out: Whether a command ran out, and stopped it.
        colour: What its sensor sees.
    """

    landings: tuple[Pose, ...]
    timed_out: bool
    colour: Colour


@dataclass
class Turtle:
    """A turtle on the canvas.

    Attributes:
        velocity: What it moves with.
        hits_wall: Whether the last step would have led it beyond a wall.
        jumps: Teleports of the next step.
    """

    name: str
    pose: Pose
    pen: Pen = field(default_factory=Pen)
    velocity: Velocity = REST
    rotation: Rotation | None = None
    hits_wall: bool = False
    jumps: list[Jump] = field(default_factory=list)
    _commanded_ns: int | None = None

    def command(self, velocity: Velocity, time_ns: int) -> None:
        """Obey a command for a second."""
        self.velocity, self._commanded_ns = velocity, time_ns
        self.end_rotation(Outcome.ABORTED)

    def rotate(self, theta_rad: float) -> Rotation:
        """Begin to turn to a heading."""
        self.end_rotation(Outcome.ABORTED)
        self.rotation = Rotation(theta_rad, self.pose.yaw_rad)
        return self.rotation

    def end_rotation(self, outcome: Outcome) -> None:
        """The goal that it turns for, if there is one, is over."""
        if self.rotation is not None:
            self.rotation.outcome = outcome
            self.rotation = None

    def advance(self, canvas: Canvas, time_ns: int) -> TurtleStep:
        """Do the step that begins at a time."""
        landings = []
        for jump in self.jumps:
            landing = jump.landing(self.pose)
            self._draw(canvas, landing)
            self.pose = landing
            landings.append(landing)
        self.jumps.clear()
        self._turn(time_ns)
        timed_out = self._end_command(time_ns)
        after = self._moved()
        # The sensor looks before the line of this step is drawn.
        colour = canvas.colour((after.x_m, after.y_m))
        self._draw(canvas, after)
        self.pose = after
        return TurtleStep(tuple(landings), timed_out, colour)

    def _end_command(self, time_ns: int) -> bool:
        """Stop if the last command is too old; whether that changed the motion."""
        if self._commanded_ns is None or time_ns - self._commanded_ns <= _COMMAND_NS:
            return False
        was_moving = self.velocity != REST
        self.velocity, self._commanded_ns = REST, None
        return was_moving

    def _turn(self, time_ns: int) -> None:
        """Turn on the spot for a goal, if there is one."""
        goal = self.rotation
        if goal is None:
            return
        if goal.is_canceling:
            self.velocity = REST
            self.end_rotation(Outcome.CANCELED)
            return
        goal.remaining_rad = wrapped(wrapped(goal.theta_rad) - self.pose.yaw_rad)
        goal.delta_rad = wrapped(goal.start_rad - self.pose.yaw_rad)
        if abs(goal.remaining_rad) < _ARRIVED_RAD:
            self.velocity = REST
            self.end_rotation(Outcome.SUCCEEDED)
        else:
            self.velocity = Velocity(0.0, 0.0, math.copysign(_TURN_RAD_S, goal.remaining_rad))
            self._commanded_ns = time_ns

    def _moved(self) -> Pose:
        """Where it is after a step, within the walls."""
        velocity, pose = self.velocity, self.pose
        yaw_rad = wrapped(pose.yaw_rad + velocity.turn_rad_s * _STEP_S)
        cos, sin = math.cos(yaw_rad) * _STEP_S, math.sin(yaw_rad) * _STEP_S
        x_m = pose.x_m + cos * velocity.ahead_m_s - sin * velocity.left_m_s
        y_m = pose.y_m + sin * velocity.ahead_m_s + cos * velocity.left_m_s
        inside = Pose(min(max(x_m, 0.0), SIZE_M), min(max(y_m, 0.0), SIZE_M), yaw_rad)
        self.hits_wall = (inside.x_m, inside.y_m) != (x_m, y_m)
        return inside

    def _draw(self, canvas: Canvas, to: Pose) -> None:
        begin, end = (self.pose.x_m, self.pose.y_m), (to.x_m, to.y_m)
        if self.pen.is_down and begin != end:
            canvas.draw(begin, end, self.pen.colour, self.pen.width)


def wrapped(angle_rad: float) -> float:
    """The same direction in [-pi, pi), as turtlesim says it."""
    wrapped_rad = math.remainder(angle_rad, math.tau)
    return -math.pi if wrapped_rad >= math.pi else wrapped_rad
