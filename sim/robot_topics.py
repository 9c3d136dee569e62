"""A simulated robot on its topics: the commands that it obeys, and what its sensors publish."""

from __future__ import annotations

import importlib
from collections import deque
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node

from sim.camera_publisher import CameraPublisher
from sim.motion import Twist
from sim.polled import PolledGroup, never
from sim.publishers import (
    OdometryPublisher,
    ScanPublisher,
    TransformPublisher,
    qos_profile,
    transform_type,
)
from sim.sensor_publishers import SensorPublisher
from sim.simulation import Simulation, Step

_LEAST_QUEUE = 100
"""Commands that may arrive from one look to the next; a robot that always looks misses none."""


class RobotTopics:
    """One robot: its publishers, its subscription, and the commands that wait to act."""

    def __init__(self, node: Node, simulation: Simulation, recorders: int) -> None:
        """Create publishers and the subscription in a node of the caller; nothing is sent yet.

        Args:
            recorders: As in :class:`sim.node.RosSimulator`.
        """
        self.simulation = simulation
        self._node, self._recorders = node, recorders
        options = simulation.options
        topics = options.topics
        self.odometry = OdometryPublisher(node, topics.odometry, options.odometry)
        self.scan = ScanPublisher(node, topics.scan, simulation.lidar)
        self.sensors = {one: SensorPublisher(node, one) for one in simulation.sensors}
        camera = simulation.camera
        self.camera = CameraPublisher(node, camera) if camera is not None else None
        tf = transform_type() if topics.tf.enabled else None
        self._transforms = tf and TransformPublisher(node, options, tf)
        package, _, name = topics.command.type.split("/")
        depth = max(topics.command.depth, _LEAST_QUEUE)
        command = self._command = topics.command.model_copy(update={"depth": depth})
        self.command: Any = node.create_subscription(
            getattr(importlib.import_module(f"{package}.msg"), name),
            command.topic,
            never,
            qos_profile(command),
            callback_group=PolledGroup(),
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
        )
        self._pending: deque[tuple[int, Twist]] = deque()
        self.commands = 0

    def start(self, stamp_ns: int) -> None:
        """Publish what is known before the first step."""
        if self._transforms is not None:
            self._transforms.publish_static(stamp_ns)

    def next_visible_ns(self) -> int | None:
        """Simulated time of the next step that publishes something that somebody hears."""
        return self.simulation.next_output_ns(
            scans=self._is_heard(self.scan),
            odometry=self._transforms is not None or self._is_heard(self.odometry),
            others=[one for one, publisher in self.sensors.items() if self._is_heard(publisher)],
            pictures=self.camera is not None and self.camera.is_heard,
        )

    def _is_heard(self, sensor: OdometryPublisher | ScanPublisher | SensorPublisher) -> bool:
        return bool(sensor.publisher.get_subscription_count() > self._recorders)

    def command_at(self, arrived_ns: int, twist: Twist) -> None:
        """Command it as by a message that arrived at a simulated time; any thread may."""
        self._pending.append((arrived_ns, twist))

    def take_commands(self, stamp_ns: int, now_ns: int) -> None:
        """Take what the queue holds, with the simulated time at which it arrived.

        Args:
            stamp_ns: ROS time at which simulated time began.
            now_ns: Simulated time.
        """
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
            arrived_ns = min(info["received_timestamp"] - stamp_ns, now_ns)
            twist = getattr(message, "twist", message)
            self.command_at(arrived_ns, Twist(twist.linear.x, twist.angular.z))

    def advance(self) -> Step:
        """Do one step with the newest command that had arrived when it begins."""
        newest = None
        while self._pending and self._pending[0][0] <= self.simulation.time_ns:
            newest = self._pending.popleft()[1]
        return self.simulation.advance(newest)

    def publish(self, step: Step, stamp_ns: int) -> None:
        """Publish what a step brought; ``stamp_ns`` is its end in ROS time."""
        if step.odometry is not None:
            self.odometry.publish(step.odometry, stamp_ns)
            if self._transforms is not None:
                self._transforms.publish(step.odometry, stamp_ns)
        if step.scan is not None:
            self.scan.publish(step.scan, stamp_ns)
        for sensor, reading in step.readings:
            self.sensors[sensor].publish(reading, stamp_ns)
        if step.is_pictured and self.camera is not None:
            self.camera.publish(step.pose, step.time_ns, stamp_ns)

    @property
    def unheard(self) -> tuple[str, ...]:
        """Other types that are published on the topic of the commands."""
        found = self._node.get_publishers_info_by_topic(self._command.topic)
        return tuple(sorted({item.topic_type for item in found} - {self._command.type}))
