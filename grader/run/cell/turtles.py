"""The turtles of a cell: runs them and keeps their ground truth.

Like that of a robot it comes from memory, and never from a topic or a service.
"""

from __future__ import annotations

import math
import threading
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
from grader.run.order import SimulatorOrder
from grader.run.stimuli.filling import plain
from sim.pacing import Lateness
from sim.turtles.simulation import Act, Event, Step, Turtles
from sim.turtles.turtle import REST

if TYPE_CHECKING:
    from sim.turtles.bounds import Colour
    from sim.turtles.polling import Request
    from sim.turtles.rotating import RotationGoal

WALL = "wall"
_MOST_ASKED = 5_000
_INCIDENTS = {Act.COMMAND_REJECTED: "not finite", Act.COMMAND_TIMEOUT: "none for 1 s"}


class SimulatedTurtles:
    """Turtles on their canvas, driven by what the student sends; keeps every step so far."""

    def __init__(self, context: Context, order: SimulatorOrder) -> None:
        # The interfaces of turtlesim may lie in an underlay that the cell has found by now.
        from sim.turtles.node import RosTurtles, make_node

        world = read_scenario_world(Path(order.world), order.values)
        self._ros = RosTurtles(make_node(context), Turtles(world.turtles), self)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._ros.run, args=(self._stop,), daemon=True)
        self.truth: list[Truth] = []
        self.incidents: list[Incident] = []
        self.events: list[TurtleEvent] = []
        self._stamp_ns = 0
        self._asked: list[Asked] = []
        self._background: Colour | None = None
        self._ways_m: dict[str, float] = {}
        self._last: dict[str, Truth] = {}
        self._rest_since_ns = 0

    def start(self) -> None:
        """Let simulated time run, in a thread of its own."""
        self._thread.start()

    def stop(self) -> None:
        """Stop simulated time; the truth ends here."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    @property
    def services(self) -> frozenset[str]:
        """What a client of the student's may call."""
        return self._ros.services

    @property
    def travelled_m(self) -> float:
        """How far the one went that went the farthest."""
        return max(self._ways_m.values(), default=0.0)

    @property
    def in_contact_s(self) -> float:
        """A wall that is hit ends nothing: turtles go on along it."""
        return 0.0

    @property
    def at_rest_s(self) -> float:
        """Simulated seconds at rest since one last moved; 0 while one moves or none has moved."""
        return (self._stamp_ns - self._rest_since_ns) / NS if self._rest_since_ns else 0.0

    def on_step(self, step: Step, stamp_ns: int) -> None:
        """Keep the truth; called by the simulation."""
        self._stamp_ns = stamp_ns
        for event in step.events:
            self._note(event, stamp_ns)
        if self._background != self._ros.background:
            self._background = self._ros.background
            self.events.append(TurtleEvent(stamp_ns, "background", colour=self._background))
        has_moved = False
        for name, state in step.turtles.items():
            pose, velocity = state.pose, state.velocity
            now = Truth(
                *(stamp_ns, pose.x_m, pose.y_m, pose.yaw_rad),
                *(velocity.ahead_m_s, velocity.turn_rad_s) * 2,
                contact=WALL if state.hits_wall else None,
                robot=name,
            )
            self.truth.append(now)
            before = self._last.get(name, now)
            way_m = math.hypot(now.x_m - before.x_m, now.y_m - before.y_m)
            self._ways_m[name] = self._ways_m.get(name, 0.0) + way_m
            has_moved |= velocity != REST or way_m > 0.0
            self._last[name] = now
        if has_moved:
            self._rest_since_ns = 0
        elif not self._rest_since_ns and self.travelled_m > 0.0:
            self._rest_since_ns = stamp_ns

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
        late_ms = lateness.late_ns / 1e6
        text = f"{lateness.steps} steps done {late_ms:.0f} ms late"
        self.incidents.append(Incident(self._stamp_ns, "late", text, lateness.late_ns / NS))

    def _note(self, event: Event, stamp_ns: int) -> None:
        if event.act in _INCIDENTS:
            text = _INCIDENTS[event.act]
            self.incidents.append(Incident(stamp_ns, event.act.value, text, robot=event.turtle))
            return
        if event.pose is None or event.pen is None:
            self.events.append(TurtleEvent(stamp_ns, event.act.value))
            return
        pose, pen = event.pose, event.pen
        self.events.append(
            TurtleEvent(
                *(stamp_ns, event.act.value, event.turtle),
                *(pose.x_m, pose.y_m, pose.yaw_rad),
                *(pen.colour, pen.width, pen.is_down),
            )
        )


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
