"""The simulator on ROS topics: a thin layer that only converts messages and keeps time.

It needs no executor: it takes commands from their subscription by itself, and wakes up only when
there is something to publish. Steps between two messages are invisible, so they are done
together with the next visible one, for a third of the CPU time; a command acts from the first
step that begins after the middleware had received it. So a moment in which this loop is held up
delays messages, which is reported, but does not change where the robot is.
"""

from __future__ import annotations

import importlib
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

import rclpy
from rclpy.callback_groups import CallbackGroup
from rclpy.context import Context
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.parameter import Parameter

from sim.motion import NS, Twist
from sim.pacing import Lateness, Pacer
from sim.publishers import (
    ClockPublisher,
    OdometryPublisher,
    ScanPublisher,
    TransformPublisher,
    qos_profile,
    transform_type,
)
from sim.simulation import Simulation, Step

_LEAST_QUEUE = 100
"""Commands that may arrive from one look to the next; a robot that always looks misses none."""


class Sink(Protocol):
    """Receiver of the truth, such as a recording; called from the loop, so it must be quick."""

    def on_step(self, step: Step, stamp_ns: int) -> None:
        """Called after each step."""

    def on_late(self, lateness: Lateness) -> None:
        """Called when steps are late, which are done right after this call."""


class PolledGroup(CallbackGroup):
    """A callback group that no executor may serve: its owner takes the messages itself."""

    def can_execute(self, entity: Any) -> bool:
        """Never."""
        return False


class RosSimulator:
    """A simulation whose robot listens and whose sensors publish.

    Its loop calls :meth:`start` once and then :meth:`catch_up` again and again, each time at or
    after the deadline that the last call returned; :meth:`run` does so until an event is set
    and suits a thread of its own.
    """

    def __init__(
        self,
        node: Node,
        simulation: Simulation,
        sink: Sink | None = None,
        steady_ns: Callable[[], int] = time.monotonic_ns,
        recorders: int = -1,
    ) -> None:
        """Create publishers and the subscription in a node of the caller; nothing is sent yet.

        Args:
            recorders: How many subscriptions to a sensor do not mind when its data come together,
                each with its own time, if they are the only ones.
        """
        self._node, self._simulation, self._sink = node, simulation, sink
        self._steady_ns = steady_ns
        options, lidar = simulation.options, simulation.lidar
        topics = options.topics
        self.odometry = OdometryPublisher(node, topics.odometry, options.odometry)
        self.scan = ScanPublisher(node, topics.scan, lidar)
        self.clock = ClockPublisher(node, topics.clock) if topics.clock.enabled else None
        tf = transform_type() if topics.tf.enabled else None
        self.transforms = tf and TransformPublisher(node, options, tf)
        package, _, name = topics.command.type.split("/")
        depth = max(topics.command.depth, _LEAST_QUEUE)
        command = self._command = topics.command.model_copy(update={"depth": depth})
        self.command: Any = node.create_subscription(
            getattr(importlib.import_module(f"{package}.msg"), name),
            command.topic,
            _never,
            qos_profile(command),
            callback_group=PolledGroup(),
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
        )
        self._recorders = recorders
        self._pacer: Pacer | None = None
        self._pending: deque[tuple[int, Twist]] = deque()
        self._stamp_ns = 0
        self.commands = 0

    def start(self) -> int:
        """Let simulated time begin now."""
        self._pacer = Pacer(self._steady_ns())
        self._stamp_ns = self._node.get_clock().now().nanoseconds
        if self.transforms is not None:
            self.transforms.publish_static(self._stamp_ns)
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
        self._take_commands(now_ns - pacer.begin_ns)
        for _ in range(due):
            step = self._simulation.advance(self._command_by(self._simulation.time_ns))
            pacer.done += 1
            self._publish(step)
        # With a clock every step is visible.
        return pacer.plan(0 if self.clock is not None else self._next_visible_ns())

    def _next_visible_ns(self) -> int | None:
        return self._simulation.next_output_ns(
            scans=self._is_heard(self.scan),
            odometry=self.transforms is not None or self._is_heard(self.odometry),
        )

    def _is_heard(self, sensor: OdometryPublisher | ScanPublisher) -> bool:
        return bool(sensor.publisher.get_subscription_count() > self._recorders)

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

    def drive(self, twist: Twist) -> None:
        """Command the robot from this process, like a message that arrives now; any thread may."""
        if self._pacer is not None:
            self._pending.append((self._steady_ns() - self._pacer.begin_ns, twist))

    @property
    def unheard(self) -> tuple[str, ...]:
        """Other types that are published on the topic of the commands."""
        found = self._node.get_publishers_info_by_topic(self._command.topic)
        return tuple(sorted({item.topic_type for item in found} - {self._command.type}))

    def _take_commands(self, now_ns: int) -> None:
        """Take what the queue holds, with the simulated time at which it arrived."""
        # Bounded, for a student may publish faster than this loop takes.
        for _ in range(self._command.depth):
            try:
                with self.command.handle:
                    taken = self.command.handle.take_message(self.command.msg_type, False)
            except RuntimeError:  # a payload that is no such message
                if not self._node.context.ok():
                    raise
                continue
            if taken is None:
                return
            self.commands += 1
            message, info = taken
            # Arrived by now, even if the system's clock has jumped meanwhile.
            arrived_ns = min(info["received_timestamp"] - self._stamp_ns, now_ns)
            twist = getattr(message, "twist", message)
            self._pending.append((arrived_ns, Twist(twist.linear.x, twist.angular.z)))

    def _command_by(self, time_ns: int) -> Twist | None:
        """The newest command that had arrived when a step begins."""
        newest = None
        while self._pending and self._pending[0][0] <= time_ns:
            newest = self._pending.popleft()[1]
        return newest

    def _publish(self, step: Step) -> None:
        stamp_ns = self._stamp_ns + step.time_ns
        if self._sink is not None:
            self._sink.on_step(step, stamp_ns)
        if self.clock is not None:
            self.clock.publish(stamp_ns)
        if step.odometry is not None:
            self.odometry.publish(step.odometry, stamp_ns)
            if self.transforms is not None:
                self.transforms.publish(step.odometry, stamp_ns)
        if step.scan is not None:
            self.scan.publish(step.scan, stamp_ns)


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


def _never(message: Any) -> None:
    """A callback that is never called, since no executor serves it."""
