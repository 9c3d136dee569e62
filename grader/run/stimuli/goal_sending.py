"""Sends goals to an action of the student, and keeps what became of them."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

from grader.assignment.stimuli.kinds.request import SendGoal
from grader.recording.interaction import NO_SERVER, Feedback, Goal
from grader.recording.model import NS
from grader.run.cell.interfaces import import_interface
from grader.run.stimuli.calling import Requesting
from grader.run.stimuli.context import StimulusContext, plays
from grader.run.stimuli.filling import filled, plain

_MOST_FEEDBACK = 5000
_ACCEPT_S = 1.0
"""How soon a server says whether it accepts a goal: its callback only decides."""
_STATUSES = {
    1: "accepted",
    2: "executing",
    3: "canceling",
    4: "succeeded",
    5: "canceled",
    6: "aborted",
}
"""Constants of action_msgs/msg/GoalStatus."""


@plays(SendGoal)
class SendingGoal(Requesting):
    """One goal, from its sending to its result."""

    def __init__(self, order: SendGoal, context: StimulusContext) -> None:
        # Stimuli are created in the order of the YAML: these goals are sent before this one.
        self._earlier_goals = [
            request
            for request in context.requests
            if isinstance(request, SendingGoal) and request._order.send_goal == order.send_goal
        ]
        send_goal = f"{order.send_goal}/_action/send_goal"
        super().__init__(order, f"an action {order.send_goal}", send_goal, context)
        self._client: Any = None
        self._handle: Any = None
        self._number: int | None = None
        self._fault: str | None = None

    @property
    def _sent(self) -> Goal | None:
        """The record of the goal, or None before it is sent."""
        return None if self._number is None else self._context.goals[self._number]

    @property
    def _is_over(self) -> bool:
        sent = self._sent
        return sent is not None and (sent.accepted is False or sent.result_ns is not None)

    @property
    def is_done(self) -> bool:
        """Whether it has ended, or was waited for; or there is no server."""
        if self._fault is not None or self._ready.given_up:
            return True
        return self._sent is not None and (self._is_over or not self._waits)

    @property
    def is_through(self) -> bool:
        """Whether it was answered; what comes after it goes out while it is worked on."""
        sent = self._sent
        if self.is_done or sent is None or self._since_sent is None:
            return self.is_done
        return sent.accepted is not None or self._since_sent.elapsed_s > _ACCEPT_S

    def holds_up(self, other: Requesting) -> bool:
        """A goal may wait for the end of another one: it holds up only what is due at once."""
        same_action = isinstance(other, SendingGoal) and other._order.subject == self._order.subject
        is_at_once = self._order.after == other._order.after
        return is_at_once and not same_action and super().holds_up(other)

    def play(self, elapsed_s: float) -> None:
        """Send it, and ask to cancel it, when that is due."""
        if self._fault is not None:
            return
        super().play(elapsed_s)
        if self._sent is not None:
            self._follow(self._sent)
        elif self._is_ready() and self._is_turn and self._is_free:
            self._send()

    def finish(self) -> None:
        """Note that it could not be sent, unless it was not due yet."""
        if self._fault is not None or self._ready.is_in_vain:
            self._note(self._order.goal, time.time_ns(), self._fault or NO_SERVER)
        elif self._ready.never_answered and self._sent is None:
            self._note(self._order.goal, self._ready.appeared_ns)

    def _note(self, goal: dict[str, Any], sent_ns: int, error: str = "") -> None:
        order = self._order
        self._number = len(self._context.goals)
        self._context.goals.append(
            Goal(
                order.send_goal,
                order.type,
                goal,
                sent_ns,
                cancel_after_s=order.cancel_after,
                preempts=order.preempt,
                error=error,
            )
        )

    def _update(self, **changes: Any) -> None:
        assert self._number is not None
        if self._context.probe.recording:
            goals = self._context.goals
            goals[self._number] = replace(goals[self._number], **changes)

    def _is_ready(self) -> bool:
        from rclpy.action.client import ActionClient

        if self._client is None:
            try:
                interface = import_interface(self._order.type)
            except ImportError as error:
                self._fault = f"the interface {self._order.type} is not installed ({error})"
                return False
            node = self._context.probe.node
            self._client = ActionClient(node, interface, self._order.send_goal)
        return self._ready.may_send(bool(self._client.server_is_ready()))

    @property
    def _is_free(self) -> bool:
        """Whether the goals before it have ended; those that it is to preempt have begun."""
        return all(
            goal.is_done or (self._order.preempt and goal._handle is not None)
            for goal in self._earlier_goals
        )

    def _send(self) -> None:
        if self._order.preempt:
            for goal in self._earlier_goals:
                if goal._sent is not None and not goal._is_over:
                    goal._update(preempted=True)
        now_ns = time.time_ns()
        message = filled(import_interface(self._order.type).Goal(), self._order.goal, now_ns)
        self._note(plain(message), now_ns)
        self._wait_for_answer()
        future = self._client.send_goal_async(message, feedback_callback=self._take_feedback)
        future.add_done_callback(self._take_acceptance)

    def _take_feedback(self, message: Any) -> None:
        sent = self._sent
        if sent is not None and len(sent.feedback) < _MOST_FEEDBACK:
            feedback = Feedback(time.time_ns(), plain(message.feedback))
            self._update(feedback=(*sent.feedback, feedback))

    def _take_acceptance(self, future: Any) -> None:
        handle = future.result()
        self._update(accepted=bool(handle.accepted), answered_ns=time.time_ns())
        if handle.accepted and self._context.probe.recording:
            self._handle = handle
            handle.get_result_async().add_done_callback(self._take_result)

    def _take_result(self, future: Any) -> None:
        answer = future.result()
        status = _STATUSES.get(answer.status, "unknown")
        self._update(result_ns=time.time_ns(), status=status, result=plain(answer.result))

    def _follow(self, sent: Goal) -> None:
        """Note a change of its status, and ask to cancel it when that is due."""
        if self._handle is None:
            return
        now_ns = time.time_ns()
        status = _STATUSES.get(self._handle.status)
        if status and (not sent.statuses or sent.statuses[-1][1] != status):
            self._update(statuses=(*sent.statuses, (now_ns, status)))
        cancel_s = self._order.cancel_after
        if cancel_s is None or sent.canceled_ns is not None or self._is_over:
            return
        if now_ns - (sent.answered_ns or now_ns) >= cancel_s * NS:
            self._update(canceled_ns=now_ns)
            # A server that works on the goal to its end takes that in only then.
            self._wait_for_answer()
            self._handle.cancel_goal_async().add_done_callback(self._take_cancellation)

    def _take_cancellation(self, future: Any) -> None:
        accepted = bool(future.result().goals_canceling)
        self._update(cancel_answered_ns=time.time_ns(), cancel_accepted=accepted)
