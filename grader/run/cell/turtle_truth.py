"""The truth of turtles, as a recording holds it; pure."""

from __future__ import annotations

import math

from grader.recording.model import NS
from grader.recording.simulated import Incident, Truth, TurtleEvent
from sim.turtles.bounds import Colour
from sim.turtles.simulation import Act, Event, Step
from sim.turtles.turtle import REST

WALL = "wall"
_INCIDENTS = {Act.COMMAND_REJECTED: "not finite", Act.COMMAND_TIMEOUT: "none for 1 s"}


class TurtleTruth:
    """Every step so far, and what happened besides motion."""

    def __init__(self) -> None:
        self.truth: list[Truth] = []
        self.incidents: list[Incident] = []
        self.events: list[TurtleEvent] = []
        self.stamp_ns = 0
        self._background: Colour | None = None
        self._ways_m: dict[str, float] = {}
        self._last: dict[str, Truth] = {}
        self._rest_since_ns = 0

    @property
    def travelled_m(self) -> float:
        """How far the one went that went the farthest."""
        return max(self._ways_m.values(), default=0.0)

    @property
    def at_rest_s(self) -> float:
        """Simulated seconds at rest since one last moved; 0 while one moves or none has moved."""
        return (self.stamp_ns - self._rest_since_ns) / NS if self._rest_since_ns else 0.0

    @property
    def in_contact_s(self) -> float:
        """A wall that is hit ends nothing: turtles go on along it."""
        return 0.0

    def keep(self, step: Step, stamp_ns: int, background: Colour) -> None:
        """Keep a step."""
        self.stamp_ns = stamp_ns
        for event in step.events:
            self._note(event)
        if self._background != background:
            self._background = background
            self.events.append(TurtleEvent(stamp_ns, "background", colour=background))
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

    def _note(self, event: Event) -> None:
        stamp_ns, kind = self.stamp_ns, event.act.value
        if event.act in _INCIDENTS:
            text = _INCIDENTS[event.act]
            self.incidents.append(Incident(stamp_ns, kind, text, robot=event.turtle))
        elif event.pose is None or event.pen is None:
            self.events.append(TurtleEvent(stamp_ns, kind))
        else:
            pose, pen = event.pose, event.pen
            place = pose.x_m, pose.y_m, pose.yaw_rad
            drawn = pen.colour, pen.width, pen.is_down
            self.events.append(TurtleEvent(stamp_ns, kind, event.turtle, *place, *drawn))
