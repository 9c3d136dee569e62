"""Publishes messages of the scenario, once a subscription of the student has matched."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.serialization import serialize_message

from grader.measure.compatibility import refusals
from grader.recording.mcap_writer import RawMessage
from grader.recording.model import Kind, Qos
from grader.run.cell.probe import import_interface, qos_profile
from grader.run.host.disturbance import Stopwatch
from grader.run.stimuli.answers import Answers
from grader.run.stimuli.context import Patience, Playing, StimulusContext, plays
from grader.run.stimuli.filling import filled

_POLL_S = 0.02
# Where the tracer declares nothing, the publisher of the answers may match a moment later.
_GRACE_S = 0.1


@dataclass(frozen=True)
class PublishOrder:
    """Publish messages.

    Attributes:
        repeat_s: Repeat the last one with this period until the end, or None.
        answer: Wait for a message on this topic before the next, or None.
    """

    topic: str
    type: str
    reliability: str
    durability: str
    depth: int
    messages: tuple[dict[str, Any] | bytes, ...]
    times_s: tuple[float, ...]
    before_launch: int = 0
    after_s: float = 0.0
    repeat_s: float | None = None
    answer: str | None = None
    within_s: float = 1.0


@plays(PublishOrder)
class Publishing(Playing):
    """A publisher of the probe with its messages."""

    def __init__(self, order: PublishOrder, context: StimulusContext) -> None:
        super().__init__(order, context)
        self._order: PublishOrder = order
        self.topic = order.topic
        self.answer = order.answer
        self._class = import_interface(order.type)
        self._qos = Qos(reliability=order.reliability, durability=order.durability)
        self._publisher: Any = context.probe.node.create_publisher(
            self._class,
            order.topic,
            qos_profile(order.reliability, order.durability, order.depth),
            # A subscription may be destroyed again before the graph is looked at the next time.
            event_callbacks=PublisherEventCallbacks(
                matched=context.probe.note_match, use_default_callbacks=False
            ),
        )
        self._sent = 0
        self._patience = Patience(f"a subscription on {order.topic}", context)
        self._ready_s: float | None = None
        self._next_s: float | None = None
        self._answers = Answers(order.within_s)
        self._since_sent = Stopwatch(context.meter)
        self._read = 0
        self._now_s = 0.0
        for _ in range(min(order.before_launch, len(order.messages))):
            self._publish()

    @property
    def is_done(self) -> bool:
        """Whether everything was published, with its answer; or nothing ever subscribed."""
        order = self._order
        if order.repeat_s is not None or self._patience.given_up:
            return True
        if self._sent < len(order.messages):
            return False
        self._listen()
        return self._answers.is_over(self._since_sent.elapsed_s)

    @property
    def due_s(self) -> float | None:
        """When the next message is due; until something subscribes, in short steps."""
        if self._next_s is None:
            return max(self._order.after_s, self._now_s + _POLL_S)
        if self._order.answer and self._sent > self._order.before_launch:
            return max(self._next_s, self._now_s + _POLL_S) if not self.is_done else None
        return self._next_s if self._is_more else None

    def play(self, elapsed_s: float) -> None:
        """Publish what is due."""
        self._now_s = elapsed_s
        if self._next_s is None:
            self._await_listener(elapsed_s)
        while self._is_more and self._next_s is not None and elapsed_s >= self._next_s:
            self._listen()
            if not self._answers.may_go_on(self._since_sent.elapsed_s):
                return
            if self._order.answer is not None:
                self._answers.ask()
            self._publish()
            self._since_sent = Stopwatch(self._context.meter)
            # A late cell must not make up for it with a burst.
            self._next_s = max(self._next_s, elapsed_s - self._gap_s()) + self._gap_s()

    @property
    def _is_more(self) -> bool:
        return self._sent < len(self._order.messages) or self._order.repeat_s is not None

    def _gap_s(self) -> float:
        times, number = self._order.times_s, self._sent
        if 0 < number < len(times):
            return times[number] - times[number - 1]
        return self._order.repeat_s or 0.0

    def _await_listener(self, elapsed_s: float) -> None:
        if not self._patience.look(self._is_listened_to()):
            self._ready_s = None
            return
        if self._ready_s is None:
            self._ready_s = elapsed_s
        if elapsed_s - self._ready_s >= _GRACE_S:
            self._next_s = elapsed_s

    def _is_listened_to(self) -> bool:
        """Whether every subscription of the student's that can match has, and there is one."""
        able = [
            item
            for item in self._context.endpoints(Kind.SUBSCRIPTION, self._order.topic)
            if item.type == self._order.type and not refusals(self._qos, item.qos)
        ]
        matched = self._publisher.get_subscription_count()
        return bool(able) and matched >= len(able) and self._context.is_heard

    def _listen(self) -> None:
        if self._order.answer is None:
            return
        messages = self._context.probe.messages
        for message in messages[self._read :]:
            if message.topic == self._order.answer and not (message.is_sent or message.join):
                self._answers.hear(message.cdr, self._since_sent.elapsed_s)
        self._read = len(messages)

    def _publish(self) -> None:
        order = self._order
        value = order.messages[min(self._sent, len(order.messages) - 1)]
        if isinstance(value, bytes):
            cdr = value
        else:
            cdr = serialize_message(filled(self._class(), value, time.time_ns()))
        stamp_ns = time.time_ns()
        self._publisher.publish(cdr)
        self._sent += 1
        if order.repeat_s is None:
            self.last_ns = stamp_ns
        self._context.probe.messages.append(
            RawMessage(order.topic, order.type, cdr, stamp_ns, stamp_ns, self._sent, is_sent=True)
        )
