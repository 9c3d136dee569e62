"""A node whose callbacks report when they start and end, run by one thread or by several."""

from __future__ import annotations

import time

import rclpy
from rclpy.callback_groups import (
    CallbackGroup,
    MutuallyExclusiveCallbackGroup,
    ReentrantCallbackGroup,
)
from rclpy.executors import (
    Executor,
    ExternalShutdownException,
    MultiThreadedExecutor,
    SingleThreadedExecutor,
)
from rclpy.node import Node
from std_msgs.msg import String

PERIOD_S = 1.0
TIMER_WORK_S = 0.4
CHATTER_WORK_S = 0.2


class ExecutorDemo(Node):
    """Two timers and a subscription that work for a while."""

    def __init__(
        self,
        timer_group: CallbackGroup | None = None,
        chatter_group: CallbackGroup | None = None,
    ) -> None:
        """Create them in callback groups; without one they are in the node's default group."""
        super().__init__('executor_demo')
        self.events = self.create_publisher(String, '/events', 10)
        self.timer_1 = self.create_timer(
            PERIOD_S, self.timer_1_callback, callback_group=timer_group
        )
        self.timer_2 = self.create_timer(
            PERIOD_S, self.timer_2_callback, callback_group=timer_group
        )
        self.subscription = self.create_subscription(
            String, '/chatter', self.chatter_callback, 10, callback_group=chatter_group
        )

    def timer_1_callback(self) -> None:
        """Work in the first timer."""
        self.work('timer_1', TIMER_WORK_S)

    def timer_2_callback(self) -> None:
        """Work in the second timer."""
        self.work('timer_2', TIMER_WORK_S)

    def chatter_callback(self, message: String) -> None:
        """Work on a message."""
        self.work('chatter', CHATTER_WORK_S)

    def work(self, callback: str, seconds: float) -> None:
        """Report the start, work, and report the end."""
        self.events.publish(String(data=f'{callback} start'))
        time.sleep(seconds)
        self.events.publish(String(data=f'{callback} end'))


def run(node: Node, executor: Executor) -> None:
    """Let an executor run the node until it is interrupted."""
    executor.add_node(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def single_threaded(args: list[str] | None = None) -> None:
    """Run one callback at a time."""
    rclpy.init(args=args)
    run(ExecutorDemo(), SingleThreadedExecutor())


def multi_threaded(args: list[str] | None = None) -> None:
    """Run the timers at the same time, but one chatter callback after the other."""
    rclpy.init(args=args)
    node = ExecutorDemo(ReentrantCallbackGroup(), MutuallyExclusiveCallbackGroup())
    run(node, MultiThreadedExecutor())
