"""An action server that computes Fibonacci numbers, slowly."""

from __future__ import annotations

import threading
import time

import rclpy
from example_interfaces.action import Fibonacci
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.node import Node

STEP_S = 0.1
LARGEST_ORDER = 30


class FibonacciServer(Node):
    """Offers the action /fibonacci; a new goal ends the one before it."""

    def __init__(self) -> None:
        """Create the action server."""
        super().__init__('fibonacci_server')
        self.current: ServerGoalHandle | None = None
        self.lock = threading.Lock()
        self.server = ActionServer(
            self,
            Fibonacci,
            'fibonacci',
            execute_callback=self.execute,
            goal_callback=self.decide,
            handle_accepted_callback=self.start,
            cancel_callback=self.cancel,
            callback_group=ReentrantCallbackGroup(),
        )

    def decide(self, goal: Fibonacci.Goal) -> GoalResponse:
        """Accept an order from 1 to 30."""
        right = 1 <= goal.order <= LARGEST_ORDER
        return GoalResponse.ACCEPT if right else GoalResponse.REJECT

    def start(self, handle: ServerGoalHandle) -> None:
        """End the goal before this one, then begin."""
        with self.lock:
            if self.current is not None and self.current.is_active:
                self.current.abort()
            self.current = handle
        handle.execute()

    def cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        """Agree to cancel."""
        return CancelResponse.ACCEPT

    def execute(self, handle: ServerGoalHandle) -> Fibonacci.Result:
        """Compute one number in each step and tell it."""
        feedback = Fibonacci.Feedback()
        feedback.sequence = [0, 1]
        result = Fibonacci.Result()
        for _ in range(handle.request.order - 1):
            time.sleep(STEP_S)
            if not handle.is_active:
                return result
            if handle.is_cancel_requested:
                handle.canceled()
                return result
            feedback.sequence.append(feedback.sequence[-1] + feedback.sequence[-2])
            handle.publish_feedback(feedback)
        with self.lock:
            if handle.is_active:
                handle.succeed()
        result.sequence = feedback.sequence
        return result


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = FibonacciServer()
    executor = MultiThreadedExecutor(num_threads=4)
    executor.add_node(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
