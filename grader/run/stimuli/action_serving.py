"""Offers an action to clients of the student."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import reduce
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
_MOST_FEEDBACK = 5000
_ENDS = {"succeeded": "succeed", "aborted": "abort", "canceled": "canceled"}


@dataclass
class _Goal:
    """A goal that is worked on: its message, which its handle has too, and its number."""

    message: Any
    number: int
    answer: Any
    feedback: tuple[Feedback, ...] = ()
    is_canceled: bool = False
    target: Target | None = None


@plays(ServeAction)
class ServingAction(Serving):
    """An action of the probe."""

    takes = "/_action/send_goal"

    def create(self, node: Any, group: ReentrantCallbackGroup) -> None:
        """Create the action server."""
        self._goals: list[_Goal] = []
        self._driven: _Goal | None = None
        ActionServer(
            node,
            self._interface,
            self._order.serve,
            self.noting_faults(self._execute),
            callback_group=group,
            goal_callback=self.noting_faults(self._decide),
            cancel_callback=self.noting_faults(self._cancel),
        )

    def _of(self, handle: Any) -> _Goal:
        return next(one for one in self._goals if one.message is handle.request)

    def _decide(self, message: Any) -> GoalResponse:
        number, answer = self.ask(message)
        if answer is None or answer.status == "rejected":
            self.note(number, ends=True, status="rejected")
            return GoalResponse.REJECT
        self._goals.append(_Goal(message, number, answer))
        self.note(number, status="accepted", accepted_ns=time.time_ns())
        return GoalResponse.ACCEPT

    def _cancel(self, handle: Any) -> CancelResponse:
        goal = self._of(handle)
        if not goal.is_canceled:
            goal.is_canceled = True
            self.note(goal.number, canceled_ns=time.time_ns())
        accepts = goal.answer.cancel == "accept"
        return CancelResponse.ACCEPT if accepts else CancelResponse.REJECT

    def _execute(self, handle: Any) -> Any:
        goal, began_s = self._of(handle), time.monotonic()
        answer, drive, robot = goal.answer, goal.answer.drive, self._robot(goal)
        if drive is not None and robot is not None:
            goal.target, self._driven = target(plain(handle.request), drive.to), goal
        status = ""
        while not status:
            time.sleep(_STEP_S)
            elapsed_s, told = time.monotonic() - began_s, len(goal.feedback)
            if told < _MOST_FEEDBACK and elapsed_s >= (told + 1) * answer.every:
                self._tell(handle, goal)
            if handle.is_cancel_requested:
                status = "canceled"
            elif goal.target is not None and robot is not None:
                status = self._drive(goal, elapsed_s)
            elif elapsed_s >= answer.takes_s:
                status = answer.status
        if self._driven is goal and robot is not None:
            robot.drive(Twist(0.0, 0.0))
        getattr(handle, _ENDS[status])()
        result = filled(self._interface.Result(), answer.result, time.time_ns())
        self.note(goal.number, ends=True, status=status, answer=plain(result))
        return result

    def _robot(self, goal: _Goal) -> SimulatedRobot | None:
        """The robot that a goal drives, if it drives one."""
        drive = goal.answer.drive
        return None if drive is None else self._context.robots[drive.robot]

    def _drive(self, goal: _Goal, elapsed_s: float) -> str:
        """Drive on to the pose of a goal; how the goal has ended, or nothing."""
        robot, takes_s = self._robot(goal), goal.answer.takes_s
        assert robot is not None and goal.target is not None and goal.answer.drive is not None
        # A newer goal takes the robot over.
        if self._driven is not goal or 0.0 < takes_s <= elapsed_s:
            return "aborted"
        twist = command(robot.pose, goal.target, goal.answer.drive.speed)
        if twist is None:
            return "succeeded"
        robot.drive(twist)
        return ""

    def _tell(self, handle: Any, goal: _Goal) -> None:
        """Give the next feedback, or the last one again, with the distance that remains."""
        values, drive = goal.answer.feedback, goal.answer.drive
        message, now_ns = self._interface.Feedback(), time.time_ns()
        if values:
            filled(message, values[min(len(goal.feedback), len(values) - 1)], now_ns)
        robot, path = self._robot(goal), drive.distance if drive is not None else None
        if path is not None and robot is not None and goal.target is not None:
            left: Any = distance_m(robot.pose, goal.target)
            nested = reduce(lambda value, name: {name: value}, reversed(path.split(".")), left)
            filled(message, nested, now_ns)
        elif not values:
            return
        goal.feedback += (Feedback(now_ns, plain(message)),)
        self.note(goal.number, feedback=goal.feedback)
        handle.publish_feedback(message)
