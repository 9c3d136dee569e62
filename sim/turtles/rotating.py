"""The action rotate_absolute of a turtle, on the services and topics that an action is made of.

See https://design.ros2.org/articles/actions.html. rclpy's ActionServer needs an executor, and
would let a goal act when a thread of it happens to run.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from action_msgs.msg import GoalStatus, GoalStatusArray
from action_msgs.srv import CancelGoal
from rclpy.qos import DurabilityPolicy, QoSProfile
from turtlesim.action import RotateAbsolute

from sim.motion import NS
from sim.turtles.polling import Inbox, Request
from sim.turtles.turtle import Outcome, Rotation

_STATUS = {
    Outcome.SUCCEEDED: GoalStatus.STATUS_SUCCEEDED,
    Outcome.ABORTED: GoalStatus.STATUS_ABORTED,
    Outcome.CANCELED: GoalStatus.STATUS_CANCELED,
}
_MOST_GOALS = 100
"""Whose results are kept."""
_MOST_SENT = 5_000


@dataclass
class RotationGoal:
    """A goal that was sent, and who waits for its result.

    Attributes:
        turtle: Name of the turtle.
        rotation: None if it was rejected.
        waiting: Requests for its result that were not answered yet.
        is_settled: Whether its end was published, and its result given to all who waited.
    """

    turtle: str
    id: Any
    theta_rad: float
    asked_ns: int
    rotation: Rotation | None
    canceled_ns: int | None = None
    ended_ns: int | None = None
    waiting: list[Request] = field(default_factory=list)
    is_settled: bool = False

    @property
    def status(self) -> int:
        """As the messages of an action say it."""
        if self.rotation is None:
            return int(GoalStatus.STATUS_UNKNOWN)
        if self.rotation.outcome is not None:
            return int(_STATUS[self.rotation.outcome])
        is_canceling = self.rotation.is_canceling
        return int(GoalStatus.STATUS_CANCELING if is_canceling else GoalStatus.STATUS_EXECUTING)


class RotationServer:
    """The action of one turtle."""

    def __init__(
        self,
        node: Any,
        inbox: Inbox,
        name: str,
        rotate: Callable[[float], Rotation | None],
        sent: list[RotationGoal],
    ) -> None:
        """Offer it.

        Args:
            name: Of the turtle.
            rotate: Begins to turn it; None if it cannot.
            sent: Each goal is appended to it.
        """
        parts, action = RotateAbsolute.Impl, f"/{name}/rotate_absolute/_action"
        self._name, self._rotate, self._sent = name, rotate, sent
        self._goals: dict[bytes, RotationGoal] = {}
        self._parts = parts
        self._feedback = node.create_publisher(parts.FeedbackMessage, f"{action}/feedback", 10)
        # Who comes later sees the status too.
        profile: Any = QoSProfile  # rclpy is typed in parts only
        last = profile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._status = node.create_publisher(GoalStatusArray, f"{action}/status", last)
        self.services = [
            inbox.serve(parts.SendGoalService, f"{action}/send_goal", self._accept),
            inbox.serve(CancelGoal, f"{action}/cancel_goal", self._cancel),
            inbox.serve(parts.GetResultService, f"{action}/get_result", self._give_result),
        ]
        self.publishers = [self._feedback, self._status]

    def tell(self) -> None:
        """Publish feedback, and answer who waits for results; called after each step."""
        for goal in [goal for goal in self._goals.values() if not goal.is_settled]:
            assert goal.rotation is not None
            if goal.rotation.outcome is None:
                message = self._parts.FeedbackMessage(goal_id=goal.id)
                message.feedback.remaining = goal.rotation.remaining_rad
                self._feedback.publish(message)
                continue
            goal.is_settled, goal.ended_ns = True, time.time_ns()
            self._publish_status()
            for request in goal.waiting:
                request.answer(self._result(goal))
            goal.waiting.clear()

    def _accept(self, request: Request) -> None:
        rotation = self._rotate(request.message.goal.theta)
        response = self._parts.SendGoalService.Response(accepted=rotation is not None)
        theta_rad, asked_ns = request.message.goal.theta, request.arrived_ns
        goal = RotationGoal(self._name, request.message.goal_id, theta_rad, asked_ns, rotation)
        if len(self._sent) < _MOST_SENT:
            self._sent.append(goal)
        if rotation is not None:
            if len(self._goals) == _MOST_GOALS:
                self._goals.pop(next(iter(self._goals)))
            self._goals[bytes(goal.id.uuid)] = goal
            _set_time(response.stamp, asked_ns)
        request.answer(response)
        self._publish_status()

    def _cancel(self, request: Request) -> None:
        response = CancelGoal.Response()
        for goal in self._meant_by(request.message.goal_info):
            assert goal.rotation is not None
            goal.rotation.is_canceling = True
            goal.canceled_ns = goal.canceled_ns or request.arrived_ns
            info = GoalStatus().goal_info
            info.goal_id = goal.id
            _set_time(info.stamp, goal.asked_ns)
            response.goals_canceling.append(info)
        if not response.goals_canceling:
            response.return_code = CancelGoal.Response.ERROR_REJECTED
        request.answer(response)
        self._publish_status()

    def _meant_by(self, info: Any) -> Iterator[RotationGoal]:
        """The goals that a request to cancel means: one, all up to a time, or all.

        It means all where both its id and its time are zero, see action_msgs/srv/CancelGoal.
        """
        id_, until_ns = bytes(info.goal_id.uuid), info.stamp.sec * NS + info.stamp.nanosec
        for key, goal in self._goals.items():
            in_time = goal.asked_ns <= until_ns if until_ns else not any(id_)
            is_running = goal.rotation is not None and goal.rotation.outcome is None
            if is_running and (key == id_ or in_time):
                yield goal

    def _give_result(self, request: Request) -> None:
        goal = self._goals.get(bytes(request.message.goal_id.uuid))
        if goal is None:
            request.answer()  # with the status UNKNOWN
        elif goal.is_settled:
            request.answer(self._result(goal))
        else:
            goal.waiting.append(request)

    def _result(self, goal: RotationGoal) -> Any:
        response = self._parts.GetResultService.Response(status=goal.status)
        if goal.rotation is not None:
            response.result.delta = goal.rotation.delta_rad
        return response

    def _publish_status(self) -> None:
        message = GoalStatusArray()
        for goal in self._goals.values():
            status = GoalStatus(status=goal.status)
            status.goal_info.goal_id = goal.id
            _set_time(status.goal_info.stamp, goal.asked_ns)
            message.status_list.append(status)
        self._status.publish(message)


def _set_time(stamp: Any, time_ns: int) -> None:
    stamp.sec, stamp.nanosec = divmod(time_ns, NS)
