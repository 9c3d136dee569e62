"""The simulator on ROS topics: a thin layer that only converts messages and keeps time.

It needs no executor: it takes commands from their subscription by itself, and wakes up only when
there is something to publish. Steps between two messages are invisible, so they are done
together with the next visible one, for a third of the CPU time; a command acts from the first
step that begins after the middleware had received it. So a moment in which this loop is held up
delays messages, which is reported, but does not change where the robot is.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter

from sim.motion import Twist
from sim.publishers import ClockPublisher
from sim.real_time import LateSink, RealTime
from sim.robot_topics import RobotTopics
from sim.simulation import STEP_NS, Simulation, Step


class Sink(LateSink, Protocol):
    """Receiver of the truth, such as a recording; called from the loop, so it must be quick."""

    def on_step(self, step: Step, stamp_ns: int, robot: str) -> None:
        """Called after each step of each robot, with its name."""


class RosSimulator(RealTime):
    """Simulated robots that listen and whose sensors publish."""

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
        super().__init__(node, sink, steady_ns, STEP_NS)
        self._sink = sink
        self.robots = {name: RobotTopics(node, one, recorders) for name, one in robots.items()}
        self._first = next(iter(robots.values()))
        clock = self._first.options.topics.clock
        self.clock = ClockPublisher(node, clock) if clock.enabled else None

    def start(self) -> int:
        """Let simulated time begin now, and publish what is fixed to the robots."""
        deadline_ns = super().start()
        for robot in self.robots.values():
            robot.start(self._stamp_ns)
        return deadline_ns

    def _take(self, now_ns: int) -> None:
        for robot in self.robots.values():
            robot.take_commands(self._stamp_ns, now_ns)

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
        if self.clock is not None:
            return super()._next_visible_ns()
        found = (robot.next_visible_ns() for robot in self.robots.values())
        return min((one for one in found if one is not None), default=None)

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
