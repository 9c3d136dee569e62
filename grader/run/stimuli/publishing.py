"""Publishes messages of the scenario, once a subscription of the student has matched."""

from __future__ import annotations

import time
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.serialization import serialize_message

from grader.assignment.stimuli.kinds.publish import Publish
from grader.measure.compatibility import refusals
from grader.recording.mcap_writer import RawMessage
from grader.recording.model import Kind, Qos
from grader.run.cell.interfaces import import_interface, qos_profile
from grader.run.host.stopwatch import Stopwatch
from grader.run.stimuli.answers import Answers
from grader.run.stimuli.context import Patience, Playing, StimulusContext, plays
from grader.run.stimuli.filling import filled

_POLL_S = 0.02
_GRACE_S = 0.1
"""Where the tracer declares nothing, the publisher of the answers may match a moment later."""


@plays(Publish)
class Publishing(Playing):
    """A publisher of the probe with its messages."""

    def __init__(self, order: Publish, context: StimulusContext) -> None:
        super().__init__(order, context)
        self._order: Publish = order
        self.topic = order.publish
        self.answer = order.answer
        self._class = import_interface(order.type)
        self._qos = Qos(reliability=order.reliability, durability=order.durability)
        self._publisher: Any = context.probe.node.create_publisher(
            self._class,
            order.publish,
            qos_profile(order.reliability, order.durability, order.depth),
            # A subscription may be destroyed again before the graph is looked at the next time.
            event_callbacks=PublisherEventCallbacks(
                matched=context.probe.note_match, use_default_callbacks=False
            ),
        )
        self._sent = 0
        self._patience = Patience(f"a subscription on {order.publish}", context)
        self._listened_to_s: float | None = None
        self._next_s: float | None = None
        self._answers = Answers(order.within)
        self._since_sent = Stopwatch(context.meter)
        self._messages_read = 0
        self._now_s = 0.0
        for _ in range(min(order.before_launch, len(order.due))):
            self._publish()

    @property
    def is_done(self) -> bool:
        """Whether everything was published, with its answer; or nothing ever subscribed."""
        order = self._order
        if not order.has_end or self._patience.given_up:
            return True
        if self._sent < len(order.due):
            return False
        self._listen()
        return self._answers.is_over(self._since_sent.elapsed_s)

    @property
    def due_s(self) -> float | None:
        """When the next message is due; until something subscribes, in short steps."""
        if self._next_s is None:
            return max(self._order.after, self._now_s + _POLL_S)
        waits_for_answers = self._order.answer and self._sent > self._order.before_launch
        if waits_for_answers:
            return None if self.is_done else max(self._next_s, self._now_s + _POLL_S)
        return self._next_s if self._has_more else None

    def play(self, elapsed_s: float) -> None:
        """Publish what is due."""
        self._now_s = elapsed_s
        if self._next_s is None:
            self._await_listener(elapsed_s)
        while self._has_more and self._next_s is not None and elapsed_s >= self._next_s:
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
    def _has_more(self) -> bool:
        return self._sent < len(self._order.due) or not self._order.has_end

    def _gap_s(self) -> float:
        """Time between the last message and the next one."""
        due, number = self._order.due, self._sent
        if 0 < number < len(due):
            (_, before_s), (_, next_s) = due[number - 1], due[number]
            return float(next_s - before_s)
        return 0.0 if self._order.has_end else float(self._order.every or 0.0)

    def _await_listener(self, elapsed_s: float) -> None:
        if not self._patience.look(self._is_listened_to()):
            self._listened_to_s = None
            return
        if self._listened_to_s is None:
            self._listened_to_s = elapsed_s
        if elapsed_s - self._listened_to_s >= _GRACE_S:
            self._next_s = elapsed_s

    def _is_listened_to(self) -> bool:
        """Whether every subscription of the student's that can match has, and there is one."""
        compatible = [
            endpoint
            for endpoint in self._context.endpoints(Kind.SUBSCRIPTION, self._order.publish)
            if endpoint.type == self._order.type and not refusals(self._qos, endpoint.qos)
        ]
        matched = self._publisher.get_subscription_count()
        return bool(compatible) and matched >= len(compatible) and self._context.is_heard

    def _listen(self) -> None:
        """Take in the answers that have been recorded since the last look."""
        if self._order.answer is None:
            return
        messages = self._context.probe.messages
        for message in messages[self._messages_read :]:
            if message.topic == self._order.answer and not (message.is_sent or message.join):
                self._answers.hear(message.cdr, self._since_sent.elapsed_s)
        self._messages_read = len(messages)

    def _publish(self) -> None:
        order = self._order
        value, _ = order.due[min(self._sent, len(order.due) - 1)]
        if isinstance(value, bytes):
            cdr = value
        else:
            cdr = serialize_message(filled(self._class(), value, time.time_ns()))
        stamp_ns = time.time_ns()
        self._publisher.publish(cdr)
        self._sent += 1
        if order.has_end:
            self.last_ns = stamp_ns
        self._context.probe.messages.append(
            RawMessage(order.publish, order.type, cdr, stamp_ns, stamp_ns, self._sent, is_sent=True)
        )
