"""A robot that drives to the victims it is given."""

import time

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from red_interfaces.action import Rescue
from red_interfaces.srv import AssignVictim
from red_rescue.robot_node import RobotNode, run

STEP_S = 0.1
SPEED = 0.25


class Medic(RobotNode):
    """Keeps the victims that it is given, and drives to one with each goal."""

    def __init__(self) -> None:
        """Create the service and the action."""
        super().__init__('medic')
        self.assigned: set[int] = set()
        self.is_driving = False
        self.create_service(AssignVictim, '/assign', self.assign)
        self.server = ActionServer(
            self,
            Rescue,
            '/rescue',
            execute_callback=self.execute,
            goal_callback=self.decide,
            cancel_callback=self.cancel,
            callback_group=ReentrantCallbackGroup(),
        )

    def speed(self) -> float:
        """Drive only to a victim."""
        return SPEED if self.is_driving else 0.0

    def assign(
        self, request: AssignVictim.Request, response: AssignVictim.Response
    ) -> AssignVictim.Response:
        """Keep a victim whose severity is possible."""
        response.accepted = 0.0 <= request.severity <= 1.0
        if response.accepted:
            self.assigned.add(request.victim)
        response.waiting = len(self.assigned)
        return response

    def decide(self, goal: Rescue.Goal) -> GoalResponse:
        """Accept only a victim that was assigned."""
        return GoalResponse.ACCEPT if goal.victim in self.assigned else GoalResponse.REJECT

    def cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        """Agree to cancel."""
        return CancelResponse.ACCEPT

    def execute(self, handle: ServerGoalHandle) -> Rescue.Result:
        """Drive as far as the goal says, or until it is canceled."""
        result = Rescue.Result()
        feedback = Rescue.Feedback()
        self.is_driving = True
        while result.driven < handle.request.distance and not handle.is_cancel_requested:
            time.sleep(STEP_S)
            result.driven += SPEED * STEP_S
            feedback.remaining = max(0.0, handle.request.distance - result.driven)
            handle.publish_feedback(feedback)
        self.is_driving = False
        if handle.is_cancel_requested:
            handle.canceled()
        else:
            self.assigned.discard(handle.request.victim)
            handle.succeed()
        return result


def main() -> None:
    """Run the node."""
    run(Medic)
