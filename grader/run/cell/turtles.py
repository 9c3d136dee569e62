"""The turtles of a cell: runs them and keeps their ground truth.

Like that of a robot it comes from memory, and never from a topic or a service.
"""

from __future__ import annotations

import time
from dataclasses import replace
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rclpy.context import Context

from grader.assignment.simulation import read_scenario_world
from grader.recording.interaction import Asked
from grader.recording.model import NS
from grader.recording.simulated import Incident, Truth, TurtleEvent
from grader.run.cell.simulated import Simulated
from grader.run.cell.turtle_truth import TurtleTruth
from grader.run.order import SimulatorOrder
from grader.run.stimuli.filling import plain
from sim.pacing import Lateness
from sim.turtles.simulation import Step, Turtles

if TYPE_CHECKING:
    from sim.turtles.polling import Request
    from sim.turtles.rotating import RotationGoal

_MOST_ASKED = 5_000


class SimulatedTurtles(Simulated):
    """Turtles on their canvas, driven by what the student sends; keeps every step so far."""

    def __init__(self, context: Context, order: SimulatorOrder) -> None:
        # The interfaces of turtlesim may lie in an underlay that the cell has found by now.
        from sim.turtles.node import RosTurtles, make_node

        self._seen = TurtleTruth()
        world = read_scenario_world(Path(order.world), order.values)
        self._ros = RosTurtles(make_node(context), Turtles(world.turtles), self)
        self._asked: list[Asked] = []

    def start(self) -> None:
        """Let simulated time run, in a thread of its own."""
        self._ros.run_in_thread()

    def stop(self) -> None:
        """Stop simulated time; the truth ends here."""
        self._ros.end()

    @property
    def services(self) -> frozenset[str]:
        """What a client of the student's may call."""
        return self._ros.services

    @property
    def moving(self) -> tuple[TurtleTruth, ...]:
        """All turtles together."""
        return (self._seen,)

    @property
    def truth(self) -> list[Truth]:
        """Every step so far of all turtles, oldest first."""
        return self._seen.truth

    @property
    def incidents(self) -> list[Incident]:
        """What happened so far, oldest first."""
        return self._seen.incidents

    @property
    def events(self) -> list[TurtleEvent]:
        """What happened besides motion."""
        return self._seen.events

    def on_step(self, step: Step, stamp_ns: int) -> None:
        """Keep the truth; called by the simulation."""
        self._seen.keep(step, stamp_ns, self._ros.background)

    def on_answer(self, request: Request, response: Any) -> None:
        """Keep what was asked, and what the answer is."""
        name, kind = request.service.srv_name, request.service.srv_type
        package, _, _ = kind.__module__.partition(".")
        # Neither those that an action is made of, nor those of parameters.
        if package not in ("turtlesim", "std_srvs") or "/_action/" in name:
            return
        if len(self._asked) < _MOST_ASKED:
            type, fields = f"{package}/srv/{kind.__name__}", plain(request.message)
            asked = Asked(name, type, fields, request.arrived_ns, "answered")
            answered = replace(asked, ended_ns=time.time_ns(), answer=plain(response))
            self._asked.append(answered)

    @property
    def asked(self) -> tuple[Asked, ...]:
        """What came to the services and actions of the turtles, in order."""
        goals = map(_asked_goal, self._ros.goals)
        return tuple(sorted((*self._asked, *goals), key=attrgetter("asked_ns")))

    def on_late(self, lateness: Lateness) -> None:
        """Note steps that are late because of the host; called by the simulation."""
        late_s = lateness.late_ns / NS
        self.incidents.append(Incident(self._seen.stamp_ns, "late", str(lateness), late_s))


def _asked_goal(goal: RotationGoal) -> Asked:
    """A goal as recordings have it."""
    server, type = f"/{goal.turtle}/rotate_absolute", "turtlesim/action/RotateAbsolute"
    fields = {"theta": goal.theta_rad}
    if goal.rotation is None:
        asked_ns = goal.asked_ns
        return Asked(server, type, fields, asked_ns, "rejected", ended_ns=asked_ns)
    outcome = goal.rotation.outcome
    return Asked(
        *(server, type, fields, goal.asked_ns),
        status="accepted" if outcome is None else outcome.value,
        accepted_ns=goal.asked_ns,
        canceled_ns=goal.canceled_ns,
        ended_ns=goal.ended_ns,
        answer=None if outcome is None else {"delta": goal.rotation.delta_rad},
    )
