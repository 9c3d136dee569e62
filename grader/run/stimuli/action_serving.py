"""Offers an action to clients of the student."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rclpy.action.server import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup

from grader.assignment.stimuli.kinds.serve import ServeAction
from grader.recording.interaction import Feedback
from grader.run.stimuli.context import plays
from grader.run.stimuli.driving import Target, command, distance_m, target
from grader.run.stimuli.filling import filled, plain
from grader.run.stimuli.serving import Serving
from sim.motion import Twist

if TYPE_CHECKING:
    from grader.run.cell.simulator import SimulatedRobot

_STEP_S = 0.02
"""Time between two looks at a goal, and two commands to a robot that it drives."""
_MOST_FEEDBACK = 5000
_METHODS_OF_HANDLE = {"succeeded": "succeed", "aborted": "abort", "canceled": "canceled"}
"""How a goal ends -> what of rclpy's goal handle says so."""


@dataclass(frozen=True)
class _Way:
    """The way of a robot to the pose that a goal names."""

    robot: SimulatedRobot
    target: Target
    speed_m_s: float


@dataclass
class _Goal:
    """A goal that is worked on.

    Attributes:
        message: The same object as in its handle.
        number: Of its record, see :meth:`Serving.note`.
        answer: What the YAML says is to become of it.
        way: None where it drives no robot.
    """

    message: Any
    number: int
    answer: Any
    feedback: tuple[Feedback, ...] = ()
    is_canceled: bool = False
    way: _Way | None = None


@plays(ServeAction)
class ServingAction(Serving):
    """An action of the probe."""

    request_suffix = "/_action/send_goal"

    def create(self, node: Any, group: ReentrantCallbackGroup) -> None:
        """Create the action server."""
        self._goals: list[_Goal] = []
        self._driving_goal: _Goal | None = None
        """The newest goal that drives: it has taken the robot over from those before."""
        ActionServer(
            node,
            self._interface,
            self._order.serve,
            self.noting_faults(self._execute),
            callback_group=group,
            goal_callback=self.noting_faults(self._decide),
            cancel_callback=self.noting_faults(self._cancel),
        )

    def _goal_of(self, handle: Any) -> _Goal:
        return next(goal for goal in self._goals if goal.message is handle.request)

    def _decide(self, message: Any) -> GoalResponse:
        number, answer = self.receive(message)
        if answer is None or answer.status == "rejected":
            self.note(number, ends=True, status="rejected")
            return GoalResponse.REJECT
        self._goals.append(_Goal(message, number, answer))
        self.note(number, status="accepted", accepted_ns=time.time_ns())
        return GoalResponse.ACCEPT

    def _cancel(self, handle: Any) -> CancelResponse:
        goal = self._goal_of(handle)
        if not goal.is_canceled:
            goal.is_canceled = True
            self.note(goal.number, canceled_ns=time.time_ns())
        accepts = goal.answer.cancel == "accept"
        return CancelResponse.ACCEPT if accepts else CancelResponse.REJECT

    def _execute(self, handle: Any) -> Any:
        """Work on an accepted goal until it has ended, in a thread of its own; give its result."""
        goal, began_s = self._goal_of(handle), time.monotonic()
        self._begin_way(goal)
        status = ""
        while not status:
            time.sleep(_STEP_S)
            elapsed_s, count = time.monotonic() - began_s, len(goal.feedback)
            if count < _MOST_FEEDBACK and elapsed_s >= (count + 1) * goal.answer.every:
                self._give_feedback(handle, goal)
            status = "canceled" if handle.is_cancel_requested else self._go_on(goal, elapsed_s)
        if goal.way is not None and self._driving_goal is goal:
            goal.way.robot.drive(Twist(0.0, 0.0))
        getattr(handle, _METHODS_OF_HANDLE[status])()
        result = filled(self._interface.Result(), goal.answer.result, time.time_ns())
        self.note(goal.number, ends=True, status=status, answer=plain(result))
        return result

    def _begin_way(self, goal: _Goal) -> None:
        drive = goal.answer.drive
        if drive is not None:
            robot = self._context.robots[drive.robot]
            goal.way = _Way(robot, target(plain(goal.message), drive.to), drive.speed)
            self._driving_goal = goal

    def _go_on(self, goal: _Goal, elapsed_s: float) -> str:
        """Drive on, or wait; how the goal has ended, or nothing."""
        takes_s, way = goal.answer.takes_s, goal.way
        if way is None:
            return goal.answer.status if elapsed_s >= takes_s else ""
        if self._driving_goal is not goal or 0.0 < takes_s <= elapsed_s:
            return "aborted"
        twist = command(way.robot.pose, way.target, way.speed_m_s)
        if twist is None:
            return "succeeded"
        way.robot.drive(twist)
        return ""

    def _give_feedback(self, handle: Any, goal: _Goal) -> None:
        """Give the next feedback, or the last one again, with the distance that remains."""
        values, drive, way = goal.answer.feedback, goal.answer.drive, goal.way
        path = drive.distance if drive is not None else None
        if not values and path is None:
            return
        message, now_ns = self._interface.Feedback(), time.time_ns()
        if values:
            filled(message, values[min(len(goal.feedback), len(values) - 1)], now_ns)
        if path is not None and way is not None:
            filled(message, _nested(path, distance_m(way.robot.pose, way.target)), now_ns)
        goal.feedback += (Feedback(now_ns, plain(message)),)
        self.note(goal.number, feedback=goal.feedback)
        handle.publish_feedback(message)


def _nested(path: str, value: Any) -> Any:
    """A value in a field: ``a.b`` and 1.0 give ``{"a": {"b": 1.0}}``."""
    for name in reversed(path.split(".")):
        value = {name: value}
    return value
