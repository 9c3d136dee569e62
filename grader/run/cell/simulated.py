"""What moves in a run: robots or turtles of rosgrade, or the robot of a program of the author's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from grader.recording.interaction import Asked
from grader.recording.simulated import Incident, Scene, Truth, TurtleEvent

if TYPE_CHECKING:
    from rclpy.node import Node

    from grader.run.cell.simulator import SimulatedRobot
    from grader.run.order import SimulatorOrder


class Moving(Protocol):
    """What the end of a run may depend on: a robot, or all turtles together."""

    @property
    def at_rest_s(self) -> float:
        """Seconds at rest since it last moved; 0 while it moves or has never moved."""

    @property
    def in_contact_s(self) -> float:
        """Seconds since the first contact that ends a run; 0 before."""

    @property
    def travelled_m(self) -> float:
        """Length of its path so far."""


class Simulated:
    """A simulation in a cell; by itself one in which nothing moves.

    Its truth comes from memory, or from messages of known publishers.
    """

    @property
    def moving(self) -> Sequence[Moving]:
        """What moves in it."""
        return ()

    @property
    def truth(self) -> Sequence[Truth]:
        """Every step so far, oldest first."""
        return ()

    @property
    def incidents(self) -> Sequence[Incident]:
        """What happened so far, oldest first."""
        return ()

    def start(self) -> None:
        """Let simulated time begin."""

    def stop(self) -> None:
        """The truth ends here."""

    @property
    def driven(self) -> Mapping[str, SimulatedRobot]:
        """The robots that a stimulus can drive, by their names."""
        return {}

    @property
    def scenes(self) -> Mapping[str, Scene]:
        """World and robot, by the names of the robots."""
        return {}

    @property
    def events(self) -> Sequence[TurtleEvent]:
        """What happened to turtles besides their motion."""
        return ()

    @property
    def asked(self) -> Sequence[Asked]:
        """What came to services and actions of its own."""
        return ()

    @property
    def services(self) -> frozenset[str]:
        """What a client of the student's may call."""
        return frozenset()


def simulated_by_us(node: Node, order: SimulatorOrder) -> Simulated:
    """Rosgrade's own simulation of a scenario: turtles or robots."""
    if order.has_turtles:
        from grader.run.cell.turtles import SimulatedTurtles

        context: Any = node.context
        return SimulatedTurtles(context, order)
    from grader.run.cell.simulator import Simulator

    return Simulator(node, order)
