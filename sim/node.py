"""The simulator on ROS topics: a thin layer that only converts messages and keeps time.

It needs no executor: it takes commands from their subscription by itself, and wakes up only when
there is something to publish. Steps between two messages are invisible, so they are done
together with the next visible one, for a third of the CPU time; a command acts from the first
step that begins after the middleware had received it. So a moment in which this loop is held up
delays messages, which is reported, but does not change where the robot is.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter

from sim.motion import NS, Twist
from sim.pacing import Lateness, Pacer
from sim.publishers import ClockPublisher
from sim.robot_topics import RobotTopics
from sim.simulation import Simulation, Step


class Sink(Protocol):
    """Receiver of the truth, such as a recording; called from the loop, so it must be quick."""

    def on_step(self, step: Step, stamp_ns: int, robot: str) -> None:
        """Called after each step of each robot, with its name."""

    def on_late(self, lateness: Lateness) -> None:
        """Called when steps are late, which are done right after this call."""


class RosSimulator:
    """Simulated robots that listen and whose sensors publish.

    Its loop calls :meth:`start` once and then :meth:`catch_up` again and again, each time at or
    after the deadline that the last call returned; :meth:`run` does so until an event is set
    and suits a thread of its own.
    """

    def __init__(
        self,
        node: Node,
        robots: Mapping[str, Simulation],
        sink: Sink | None = None,
        steady_ns: Callable[[], int] = time.monotonic_ns,
        recorders: int = -1,
    ) -> None:
        """Create publishers and subscriptions in a node of the caller; nothing is sent yet.

        Args:
            robots: Name -> simulation of it; at least one. All keep the same time.
            recorders: How many subscriptions to a sensor do not mind when its data come together,
                each with its own time, if they are the only ones.
        """
        self._node, self._sink, self._steady_ns = node, sink, steady_ns
        self.robots = {name: RobotTopics(node, one, recorders) for name, one in robots.items()}
        self._first = next(iter(robots.values()))
        clock = self._first.options.topics.clock
        self.clock = ClockPublisher(node, clock) if clock.enabled else None
        self._pacer: Pacer | None = None
        self._stamp_ns = 0

    def start(self) -> int:
        """Let simulated time begin now."""
        self._pacer = Pacer(self._steady_ns())
        self._stamp_ns = self._node.get_clock().now().nanoseconds
        for robot in self.robots.values():
            robot.start(self._stamp_ns)
        return self._pacer.deadline_ns

    def catch_up(self) -> int:
        """Do every step that is over.

        Returns:
            Reading of the steady clock at which to call again; in the past if there was more
            to catch up than is done at once. Calling earlier does no harm.
        """
        if self._pacer is None:
            return self.start()
        pacer, now_ns = self._pacer, self._steady_ns()
        due = pacer.due(now_ns)
        if not due:
            return pacer.deadline_ns
        lateness = pacer.lateness(now_ns)
        if lateness is not None and self._sink is not None:
            self._sink.on_late(lateness)
        for robot in self.robots.values():
            robot.take_commands(self._stamp_ns, now_ns - pacer.begin_ns)
        for _ in range(due):
            self._advance()
            pacer.done += 1
        # With a clock every step is visible.
        return pacer.plan(0 if self.clock is not None else self._next_visible_ns())

    def _advance(self) -> None:
        steps = {name: robot.advance() for name, robot in self.robots.items()}
        stamp_ns = self._stamp_ns + self._first.time_ns
        if self._sink is not None:
            for name, step in steps.items():
                self._sink.on_step(step, stamp_ns, name)
        if self.clock is not None:
            self.clock.publish(stamp_ns)
        for name, step in steps.items():
            self.robots[name].publish(step, stamp_ns)

    def _next_visible_ns(self) -> int | None:
        found = (robot.next_visible_ns() for robot in self.robots.values())
        return min((one for one in found if one is not None), default=None)

    def run(self, stop: threading.Event) -> None:
        """Keep time until ``stop`` is set or the node's context is shut down."""
        deadline_ns = self.start()
        while not stop.is_set() and self._node.context.ok():
            wait_s = (deadline_ns - self._steady_ns()) / NS
            if wait_s > 0.0 and stop.wait(wait_s):
                return
            try:
                deadline_ns = self.catch_up()
            except RuntimeError:  # the base of rclpy's RCLError
                if self._node.context.ok():
                    raise
                return  # the context was shut down within the step

    def drive(self, twist: Twist, robot: str) -> None:
        """Command a robot from this process, like a message that arrives now; any thread may."""
        if self._pacer is not None:
            self.robots[robot].command_at(self._steady_ns() - self._pacer.begin_ns, twist)


def make_node(name: str, context: Context) -> Node:
    """A node without services, /rosout and arguments, by which a student could disturb it."""
    parameter: Any = Parameter  # rclpy is typed in parts only
    return rclpy.create_node(
        name,
        context=context,
        use_global_arguments=False,
        enable_rosout=False,
        start_parameter_services=False,
        parameter_overrides=[parameter("start_type_description_service", value=False)],
    )
