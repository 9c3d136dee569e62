"""Sends goals to an action of the student, and keeps what became of them."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from grader.recording.interaction import Feedback, Goal
from grader.run.cell.probe import import_interface
from grader.run.stimuli.asking import NO_SERVER
from grader.run.stimuli.calling import Asking
from grader.run.stimuli.context import StimulusContext, plays
from grader.run.stimuli.filling import filled, plain

_MOST_FEEDBACK = 5000
_ACCEPT_S = 1.0
"""How soon a server says whether it accepts a goal: its callback only decides."""
# action_msgs/msg/GoalStatus
_STATUSES = {
    1: "accepted",
    2: "executing",
    3: "canceling",
    4: "succeeded",
    5: "canceled",
    6: "aborted",
}


@dataclass(frozen=True)
class GoalOrder:
    """Send a goal to an action.

    Attributes:
        cancel_after_s: Ask to cancel it so long after it was accepted, or None.
    """

    action: str
    type: str
    goal: dict[str, Any]
    after_s: float = 0.0
    cancel_after_s: float | None = None
    preempt: bool = False
    within_s: float = 10.0


@dataclass
class SentGoal:
    """A goal under way, or one that could not be sent."""

    order: GoalOrder
    goal: Mapping[str, Any]
    sent_ns: int
    accepted: bool | None = None
    answered_ns: int | None = None
    feedback: list[Feedback] = field(default_factory=list)
    statuses: list[tuple[int, str]] = field(default_factory=list)
    canceled_ns: int | None = None
    cancel_answered_ns: int | None = None
    cancel_accepted: bool | None = None
    status: str = ""
    result: Mapping[str, Any] | None = None
    result_ns: int | None = None
    preempted: bool = False
    error: str = ""

    @property
    def is_over(self) -> bool:
        """Whether it was rejected, has its result, or was never sent."""
        return self.accepted is False or self.result_ns is not None or bool(self.error)

    @property
    def record(self) -> Goal:
        """For the recording."""
        order = self.order
        seen = {key: value for key, value in vars(self).items() if key != "order"}
        return Goal(
            action=order.action,
            type=order.type,
            cancel_after_s=order.cancel_after_s,
            preempts=order.preempt,
            **{**seen, "feedback": tuple(self.feedback), "statuses": tuple(self.statuses)},
        )


@plays(GoalOrder)
class SendingGoal(Asking):
    """One goal, from its sending to its result."""

    def __init__(self, order: GoalOrder, context: StimulusContext) -> None:
        """Nothing is sent yet."""
        super().__init__(
            order, f"an action {order.action}", f"{order.action}/_action/send_goal", context
        )
        self._order = order
        # Those of the orders before it are there already, and are waited for.
        self._before = [
            item
            for item in context.asking
            if isinstance(item, SendingGoal) and item._order.action == order.action
        ][:-1]
        self._client: Any = None
        self._handle: Any = None
        self._sent: SentGoal | None = None
        self._failed: str | None = None

    @property
    def is_done(self) -> bool:
        """Whether it has ended, or was waited for; or nobody was there."""
        if self._failed is not None or self._ready.given_up:
            return True
        return self._sent is not None and (self._sent.is_over or not self._waits)

    @property
    def is_through(self) -> bool:
        """Whether it was answered; what comes after it goes out while it is worked on."""
        if self.is_done or self._sent is None or self._since_asked is None:
            return self.is_done
        return self._sent.accepted is not None or self._since_asked.elapsed_s > _ACCEPT_S

    def holds_up(self, other: Asking) -> bool:
        """A goal may wait for the end of another one: it holds up only what is due at once."""
        is_goal = isinstance(other, SendingGoal) and other._order.action == self._order.action
        return self.after_s == other.after_s and not is_goal and super().holds_up(other)

    def tick(self, elapsed_s: float | None) -> None:
        """Send it, and ask to cancel it, when that is due."""
        if elapsed_s is None or elapsed_s < self._order.after_s or self._failed is not None:
            return
        self._go_on(elapsed_s)
        if self._sent is None:
            if self._is_ready() and self._is_turn and self._is_free:
                self._send()
            return
        self._follow(self._sent)

    def finish(self) -> None:
        """Note that it could not be sent, unless it was not due yet."""
        if self._failed is not None or self._ready.is_in_vain:
            error = self._failed or NO_SERVER
            self._note(SentGoal(self._order, self._order.goal, time.time_ns(), error=error))
        elif self._ready.never_answered and self._sent is None:
            self._note(SentGoal(self._order, self._order.goal, self._ready.there_ns))

    def _is_ready(self) -> bool:
        from rclpy.action.client import ActionClient

        if self._client is None:
            try:
                interface = import_interface(self._order.type)
            except ImportError as error:
                self._failed = f"the interface {self._order.type} is not installed ({error})"
                return False
            node = self._context.probe.node
            self._client = ActionClient(node, interface, self._order.action)
        return self._ready.met(bool(self._client.server_is_ready()))

    @property
    def _is_free(self) -> bool:
        """Whether the goals before it have ended; those that it is to preempt have begun."""
        return all(
            item.is_done or (self._order.preempt and item._handle is not None)
            for item in self._before
        )

    def _send(self) -> None:
        if self._order.preempt:
            for item in self._before:
                if item._sent is not None and not item._sent.is_over:
                    item._sent.preempted = True
        now_ns = time.time_ns()
        message = filled(import_interface(self._order.type).Goal(), self._order.goal, now_ns)
        sent = self._sent = SentGoal(self._order, plain(message), now_ns)
        self._note(sent)
        self._wait_for_answer()

        def take(message: Any) -> None:
            if self._context.probe.recording and len(sent.feedback) < _MOST_FEEDBACK:
                sent.feedback.append(Feedback(time.time_ns(), plain(message.feedback)))

        future = self._client.send_goal_async(message, feedback_callback=take)
        future.add_done_callback(lambda done: self._answer(sent, done))

    def _note(self, sent: SentGoal) -> None:
        self._context.goals.append(sent)

    def _answer(self, sent: SentGoal, future: Any) -> None:
        if not self._context.probe.recording:
            return
        handle = future.result()
        sent.accepted, sent.answered_ns = bool(handle.accepted), time.time_ns()
        if sent.accepted:
            self._handle = handle
            handle.get_result_async().add_done_callback(lambda done: self._end(sent, done))

    def _end(self, sent: SentGoal, future: Any) -> None:
        if not self._context.probe.recording:
            return
        answer = future.result()
        sent.result_ns = time.time_ns()
        sent.status = _STATUSES.get(answer.status, "unknown")
        sent.result = plain(answer.result)

    def _follow(self, sent: SentGoal) -> None:
        """Note a new status, and ask to cancel when it is due."""
        if self._handle is None:
            return
        status = _STATUSES.get(self._handle.status)
        if status and (not sent.statuses or sent.statuses[-1][1] != status):
            sent.statuses.append((time.time_ns(), status))
        cancel_s = self._order.cancel_after_s
        if cancel_s is None or sent.canceled_ns is not None or sent.is_over:
            return
        now_ns = time.time_ns()
        if now_ns - (sent.answered_ns or now_ns) >= cancel_s * 1e9:
            sent.canceled_ns = now_ns
            # A server that works on the goal to its end takes that in only then.
            self._wait_for_answer()
            self._handle.cancel_goal_async().add_done_callback(
                lambda done: self._cancel(sent, done)
            )

    def _cancel(self, sent: SentGoal, future: Any) -> None:
        if self._context.probe.recording:
            sent.cancel_answered_ns = time.time_ns()
            sent.cancel_accepted = bool(future.result().goals_canceling)
