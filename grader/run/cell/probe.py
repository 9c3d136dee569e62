"""The probe: rosgrade's node in the cell. It observes, it never judges.

It offers no parameter services, publishes no log and has no use_sim_time, so that nothing a
student sends can change it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import rclpy
from rcl_interfaces.msg import Log
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.context import Context
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from grader.recording.mcap_writer import RawMessage
from grader.recording.model import NS, PROBE_NODE, Endpoint, Kind, LogLine, Owner
from grader.run.cell.executor_calls import ExecutorCalls
from grader.run.cell.interfaces import import_interface, qos_profile
from grader.run.order import RunLimits, Topic
from grader.run.process.output import KeptLines

_BEFORE_ALL_NS = 1
"""What a source timestamp before 1970 is recorded as: earlier than all true ones."""
_LAST_SEQUENCE = 2**32 - 1
"""A recording holds the sequence number of a message in 32 bits."""
_ROSOUT = "/rosout"
_ROSOUT_DEPTH = 1000
_LONG_QUEUE = 100
"""Depth from which on messages may wait: at a tenth of a second, no more than 1000 Hz fill it."""
_LONGEST_LOG_TEXT, _LONGEST_LOGGER_NAME = 8192, 256
_LEVELS = {10: "DEBUG", 20: "INFO", 30: "WARN", 40: "ERROR", 50: "FATAL"}


def match_events(on_match: Callable[[Any], None]) -> SubscriptionEventCallbacks:
    """Events of a subscription without rclpy's own, which only warn and cost CPU time."""
    return SubscriptionEventCallbacks(matched=on_match, use_default_callbacks=False)


class _PolledMessages(MutuallyExclusiveCallbackGroup):
    """For a subscription whose messages the probe takes itself: to be woken for each takes long.

    The executor is woken by its first publisher only, because in Fast DDS a message that waits
    wakes also an executor that asked for the events of its subscription.
    """

    is_matched = False

    def can_execute(self, entity: Any) -> bool:
        """Whether the executor may call it."""
        is_event = not isinstance(entity, Subscription)
        return is_event and not self.is_matched and super().can_execute(entity)


class Probe:
    """Subscribes to the scenario's topics, and records what arrives.

    Attributes:
        executor_calls: The calls that show whether nodes spin.
        counts: Topic of the student -> how many messages have arrived.
        recording: Whether what is received is still recorded.
        afterwards: Topic -> when messages were received since recording ended.
    """

    def __init__(self, domain_id: int) -> None:
        self._context = Context()
        rclpy.init(args=[], context=self._context, domain_id=domain_id)
        self.node = Node(
            PROBE_NODE,
            context=self._context,
            start_parameter_services=False,
            enable_rosout=False,
            use_global_arguments=False,
            parameter_overrides=[Parameter("start_type_description_service", value=False)],
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self.executor_calls = ExecutorCalls(self.node)
        self._polled: list[tuple[Any, Callable[[Any, Any], None]]] = []
        """Subscriptions with a long queue, and what receives their messages."""
        self._is_flooded = False
        self._topics: dict[str, Topic] = {}
        self._limits: RunLimits | None = None
        self._topics_heard_twice: set[str] = set()
        self._messages_heard_twice: set[tuple[str, int, int]] = set()
        self.messages: list[RawMessage] = []
        self._logs = KeptLines(0)
        self.counts: dict[str, int] = {}
        self._received: dict[tuple[str, str], int] = {}
        """Topic and late joiner -> how many messages have arrived, kept or not."""
        self.last_message_ns: int | None = None
        self.recording = True
        self.afterwards: dict[str, list[int]] = {}
        self._has_met = False

    def listen(self, topics: tuple[Topic, ...], limits: RunLimits) -> None:
        """Record topics from now on."""
        self._limits = limits
        self._logs = KeptLines(limits.output_bytes)
        # Also what was published before the probe was matched.
        profile = qos_profile("reliable", "transient_local", _ROSOUT_DEPTH)
        self._create_subscription(_ROSOUT, Log, profile, self._take_log, raw=False)
        for topic in topics:
            self._topics[topic.name] = topic
            if not topic.ours:
                self.counts[topic.name] = 0
            self._subscribe(topic, topic.reliability, topic.durability)

    def spin_once(self, limit_s: float) -> None:
        """Handle what has arrived, after at most so long a wait.

        Services, what is in short queues, and a publisher that comes or goes end the wait.
        """
        self._executor.spin_once(timeout_sec=0.0 if self._is_flooded else limit_s)
        taken = [self._take(subscription, receive) for subscription, receive in self._polled]
        # A queue that was a quarter full may run over in the next wait.
        self._is_flooded = any(count > _LONG_QUEUE // 4 for count in taken)

    def has_met(self) -> bool:
        """Whether an endpoint came or went at one of the probe's since this was last asked."""
        met, self._has_met = self._has_met, False
        return met

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown(timeout_sec=1.0)
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)

    @property
    def student_topics(self) -> tuple[str, ...]:
        """Topics that are recorded and that only the student publishes on."""
        return tuple(name for name, topic in self._topics.items() if not topic.ours)

    def interval_s(self) -> float:
        """How far apart the student's messages are on average, where they are rarest."""
        times_ns: dict[str, list[int]] = {name: [] for name in self.student_topics}
        for message in self.messages:
            if message.topic in times_ns:
                times_ns[message.topic].append(message.received_ns)
        means_s = [
            (times[-1] - times[0]) / NS / (len(times) - 1)
            for times in times_ns.values()
            if len(times) > 1
        ]
        return max(means_s, default=0.0)

    def join(self, name: str, topic: str, type: str, profile: QoSProfile) -> Any:
        """Subscribe to a topic from now on, and record it under a name of its own."""

        def receive(data: bytes, info: Any) -> None:
            self._keep(topic, type, data, info, name)

        return self._create_subscription(topic, import_interface(type), profile, receive)

    def matches(self, endpoint: Endpoint) -> bool:
        """Whether it is a publisher that is recorded, or subscribes to the simulator."""
        topic = self._topics.get(endpoint.topic)
        if topic is None or endpoint.owner is not Owner.STUDENT or endpoint.type != topic.type:
            return False
        return endpoint.kind is (Kind.SUBSCRIPTION if topic.ours else Kind.PUBLISHER)

    def subscribe_leniently(self, endpoint: Endpoint) -> None:
        """Also hear a publisher whose QoS does not match what the probe requested."""
        topic = self._topics[endpoint.topic]
        offered = endpoint.qos
        if endpoint.kind is not Kind.PUBLISHER or topic.name in self._topics_heard_twice:
            return
        too_unreliable = topic.reliability == "reliable" and offered.reliability == "best_effort"
        too_volatile = topic.durability == "transient_local" and offered.durability == "volatile"
        if too_unreliable or too_volatile:
            self._topics_heard_twice.add(topic.name)
            self._subscribe(topic, "best_effort", "volatile")

    def _subscribe(self, topic: Topic, reliability: str, durability: str) -> None:
        profile = qos_profile(reliability, durability, topic.depth)

        # rclpy decides by the number of parameters whether a callback gets the message info.
        def receive(data: bytes, info: Any) -> None:
            self._receive(topic, data, info)

        self._create_subscription(topic.name, import_interface(topic.type), profile, receive)

    def _create_subscription(
        self,
        topic: str,
        type: Any,
        profile: QoSProfile,
        receive: Any,
        *,
        raw: bool = True,
    ) -> Any:
        group = _PolledMessages() if profile.depth >= _LONG_QUEUE else None

        def met(event: Any) -> None:
            if group is not None:
                group.is_matched = True
            self.note_match(event)

        subscription = self.node.create_subscription(
            type,
            topic,
            receive,
            profile,
            callback_group=group,
            event_callbacks=match_events(met),
            raw=raw,
        )
        if group is not None:
            self._polled.append((subscription, receive))
        return subscription

    def _take(self, subscription: Any, receive: Callable[[Any, Any], None]) -> int:
        """Hand over what waits in a subscription; returns how many messages."""
        for count in range(_ROSOUT_DEPTH):
            try:
                with subscription.handle:
                    taken = subscription.handle.take_message(
                        subscription.msg_type, subscription.raw
                    )
            except RuntimeError:  # a payload that is no such message
                continue
            if taken is None:
                return count
            receive(*taken)
        return _ROSOUT_DEPTH

    @property
    def logs(self) -> list[LogLine]:
        """What loggers published on /rosout so far, within bounds."""
        return self._logs.lines

    def _take_log(self, record: Any, _: Any) -> None:
        stamp_ns = record.stamp.sec * NS + record.stamp.nanosec
        name = _valid_text(record.name, _LONGEST_LOGGER_NAME)
        text = _valid_text(record.msg, _LONGEST_LOG_TEXT)
        level = _LEVELS.get(int(record.level), str(record.level))
        # What is recorded has a time after 1970.
        time_ns = stamp_ns if stamp_ns >= 0 else time.time_ns()
        self._logs.add(LogLine(time_ns, name, "rosout", text, level))

    def note_match(self, _: Any) -> None:
        """Have the graph looked at soon: an endpoint came or went, as the middleware tells."""
        self._has_met = True

    def _receive(self, topic: Topic, data: bytes, info: Any) -> None:
        if self._limits is None:
            return
        if not self.recording:
            received_ns = self.afterwards.setdefault(topic.name, [])
            if len(received_ns) < self._limits.messages:
                received_ns.append(info["received_timestamp"])
            return
        # A topic with a lenient second subscription may deliver a message twice.
        key = (topic.name, info["source_timestamp"], info["publication_sequence_number"])
        if key in self._messages_heard_twice:
            return
        if topic.name in self._topics_heard_twice:
            self._messages_heard_twice.add(key)
        if not topic.ours:
            self.counts[topic.name] += 1
            self.last_message_ns = info["received_timestamp"]
        self._keep(topic.name, topic.type, data, info)

    def _keep(self, topic: str, type: str, data: bytes, info: Any, join: str = "") -> None:
        """Keep a message, within bounds for each topic and late joiner."""
        if not self.recording or self._limits is None:
            return
        count = self._received.get((topic, join), 0) + 1
        self._received[topic, join] = count
        if count > self._limits.messages or len(data) > self._limits.message_bytes:
            return
        # The writer may have forged both: a value that the format of a recording cannot hold
        # becomes one that no check takes for a time or a number.
        stamp_ns, sequence = info["source_timestamp"], info["publication_sequence_number"] or 0
        self.messages.append(
            RawMessage(
                topic,
                type,
                bytes(data),
                stamp_ns if stamp_ns >= 0 else _BEFORE_ALL_NS,
                info["received_timestamp"],
                sequence if 0 <= sequence <= _LAST_SEQUENCE else 0,
                join,
            )
        )


def _valid_text(text: Any, most: int) -> str:
    """The beginning of a text; what is no Unicode (a lone surrogate) becomes a question mark."""
    return str(text)[:most].encode(errors="replace").decode()
