"""The probe: rosgrade's node in the cell. It observes, it never judges.

It offers no parameter services, publishes no log and has no use_sim_time, so that nothing a
student sends can change it.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import rclpy
from rcl_interfaces.msg import Log
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.context import Context
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.exceptions import InvalidServiceNameException
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from grader.recording.interaction import EXECUTOR_SERVICES, executor_services
from grader.recording.interface import FEEDBACK
from grader.recording.mcap_writer import RawMessage
from grader.recording.model import NS, PROBE_NODE, Call, Endpoint, Kind, LogLine, Owner
from grader.run.order import RunLimits, Topic
from grader.run.process.output import KeptLines

_BEFORE_ALL_NS = 1
_LAST_SEQUENCE = 2**32 - 1
# One lost answer must not end the observation, and a blocked node must not be flooded.
_MOST_UNANSWERED = 5
_ROSOUT = "/rosout"
_ROSOUT_DEPTH = 1000
_LONG_QUEUE = 100
"""Depth from which on messages may wait: at a tenth of a second, no more than 1000 Hz fill it."""
_LONGEST = 8192
_LONGEST_NAME = 256
_LEVELS = {10: "DEBUG", 20: "INFO", 30: "WARN", 40: "ERROR", 50: "FATAL"}


def import_interface(name: str) -> Any:
    """Import a message class by its interface name."""
    package, kind, short = name.removesuffix(FEEDBACK).split("/")
    try:
        found = getattr(importlib.import_module(f"{package}.{kind}"), short)
        return found.Impl.FeedbackMessage if name.endswith(FEEDBACK) else found
    except AttributeError as error:
        raise ImportError(f"no interface {name}") from error


def qos_profile(reliability: str, durability: str, depth: int) -> QoSProfile:
    """A profile with history keep_last, in the words of the YAML."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy[reliability.upper()],
        durability=DurabilityPolicy[durability.upper()],
    )


@dataclass
class _Pending:
    requested_ns: int
    servers: int
    future: Any = None
    answers: int = 0
    answered_ns: int | None = None

    def answer(self) -> None:
        """Count an answer; the call is answered when every server has."""
        self.answers += 1
        if self.answers == self.servers:
            self.answered_ns = time.time_ns()


def match_events(on_match: Callable[[Any], None]) -> SubscriptionEventCallbacks:
    """Events of a subscription without rclpy's own, which only warn and cost CPU time."""
    return SubscriptionEventCallbacks(matched=on_match, use_default_callbacks=False)


class Waiting(MutuallyExclusiveCallbackGroup):
    """A subscription whose messages wait until they are taken: to be woken for each takes long.

    The executor is woken by its first publisher only, because in Fast DDS a message that waits
    wakes also an executor that asked for the events of its subscription.
    """

    is_matched = False

    def can_execute(self, entity: Any) -> bool:
        """Whether the executor may call it."""
        is_event = not isinstance(entity, Subscription)
        return is_event and not self.is_matched and super().can_execute(entity)


class Probe:
    """Subscribes to the scenario's topics and calls parameter services.

    Attributes:
        counts_servers: Whether a call is answered only when every server of its service has;
            what is left of a killed process stays in the graph, but answers nothing.
        recording: Whether what is received is still recorded.
        afterwards: Topic -> when messages were received since then.
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
        self._waiting: list[tuple[Any, Callable[[Any, Any], None]]] = []
        self._is_flooded = False
        self._topics: dict[str, Topic] = {}
        self._limits: RunLimits | None = None
        self._fallbacks: set[str] = set()
        self._seen: set[tuple[str, int, int]] = set()
        self._clients: dict[str, Any] = {}
        self._calls: dict[str, list[_Pending]] = {}
        self.messages: list[RawMessage] = []
        self._logs = KeptLines(0)
        self.counts: dict[str, int] = {}
        self._kept: dict[tuple[str, str], int] = {}
        self.last_message_ns: int | None = None
        self.recording = True
        self.afterwards: dict[str, list[int]] = {}
        self.counts_servers = True
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
        taken = [self._take(*one) for one in self._waiting]
        self._is_flooded = any(number > _LONG_QUEUE // 4 for number in taken)

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
        times: dict[str, list[int]] = {name: [] for name in self.student_topics}
        for item in self.messages:
            if item.topic in times:
                times[item.topic].append(item.received_ns)
        found = ((all_[-1] - all_[0]) / NS / (len(all_) - 1) for all_ in times.values() if all_[1:])
        return max(found, default=0.0)

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
        if endpoint.kind is not Kind.PUBLISHER:
            return
        offered = endpoint.qos
        heard = not (
            (topic.reliability == "reliable" and offered.reliability == "best_effort")
            or (topic.durability == "transient_local" and offered.durability == "volatile")
        )
        if heard or topic.name in self._fallbacks:
            return
        self._fallbacks.add(topic.name)
        self._subscribe(topic, "best_effort", "volatile")

    def answers(self, node: str) -> bool | None:
        """Whether a node answered what it answers only while it spins; None if not called."""
        calls = [call for name in executor_services(node) for call in self._calls.get(name, ())]
        return any(call.answered_ns is not None for call in calls) if calls else None

    def last_called_ns(self, node: str) -> int:
        """When such a service of a node was called for the last time; 0 for never."""
        calls = (call for name in executor_services(node) for call in self._calls.get(name, ()))
        return max((call.requested_ns for call in calls), default=0)

    def call_executor(self, node: str, name: str) -> None:
        """Call a service that a node answers only while it spins, unless many are unanswered."""
        kind = import_interface(EXECUTOR_SERVICES[name])
        service = f"{node}/{name}"
        if service not in self._clients:
            try:
                self._clients[service] = self.node.create_client(kind, service)
            except InvalidServiceNameException:
                # A node of a very long name, whose own services ROS would not allow either.
                return
            self._calls[service] = []
            _count_answers(self._clients[service], self._calls[service])
        client, calls = self._clients[service], self._calls[service]
        unanswered = sum(call.answered_ns is None for call in calls)
        if unanswered >= _MOST_UNANSWERED or not client.service_is_ready():
            return
        servers = self.node.count_services(service) if self.counts_servers else 1
        pending = _Pending(time.time_ns(), max(1, servers))
        pending.future = client.call_async(kind.Request())
        calls.append(pending)

    @property
    def calls(self) -> tuple[Call, ...]:
        """Every call so far, oldest first."""
        found = []
        for service, calls in self._calls.items():
            kind = EXECUTOR_SERVICES[service.rpartition("/")[2]]
            found += [
                Call(service, kind, call.requested_ns, call.answered_ns, servers=call.servers)
                for call in calls
            ]
        return tuple(sorted(found, key=lambda call: call.requested_ns))

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
        group = Waiting() if profile.depth >= _LONG_QUEUE else None

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
            self._waiting.append((subscription, receive))
        return subscription

    def _take(self, subscription: Any, receive: Callable[[Any, Any], None]) -> int:
        """Hand over what waits in a subscription; returns how many messages."""
        for number in range(_ROSOUT_DEPTH):
            try:
                with subscription.handle:
                    taken = subscription.handle.take_message(
                        subscription.msg_type, subscription.raw
                    )
            except RuntimeError:  # a payload that is no such message
                continue
            if taken is None:
                return number
            receive(*taken)
        return _ROSOUT_DEPTH

    @property
    def logs(self) -> list[LogLine]:
        """What loggers published on /rosout so far, within bounds."""
        return self._logs.lines

    def _take_log(self, record: Any, _: Any) -> None:
        stamp_ns = record.stamp.sec * NS + record.stamp.nanosec
        name, text = (
            str(value)[:longest].encode(errors="replace").decode()
            for value, longest in ((record.name, _LONGEST_NAME), (record.msg, _LONGEST))
        )
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
            received = self.afterwards.setdefault(topic.name, [])
            received += [info["received_timestamp"]] * (len(received) < self._limits.messages)
            return
        stamp_ns, sequence = info["source_timestamp"], info["publication_sequence_number"]
        key = (topic.name, stamp_ns, sequence)
        # A topic with a lenient second subscription may deliver a message twice.
        if key in self._seen:
            return
        if topic.name in self._fallbacks:
            self._seen.add(key)
        if not topic.ours:
            self.counts[topic.name] += 1
            self.last_message_ns = info["received_timestamp"]
        self._keep(topic.name, topic.type, data, info)

    def _keep(self, topic: str, type: str, data: bytes, info: Any, join: str = "") -> None:
        """Keep a message, within bounds for each topic and late joiner."""
        if not self.recording or self._limits is None:
            return
        number = self._kept[topic, join] = self._kept.get((topic, join), 0) + 1
        if number > self._limits.messages or len(data) > self._limits.message_bytes:
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


def _count_answers(client: Any, calls: list[_Pending]) -> None:
    """Count every answer to a client's calls, of which rclpy hands on only the first."""
    find = client.get_pending_request
    asked: dict[int, _Pending] = {}

    def found(sequence: int) -> Any:
        if sequence not in asked:
            future = find(sequence)
            asked[sequence] = next(call for call in calls if call.future is future)
        asked[sequence].answer()
        return find(sequence)

    client.get_pending_request = found
