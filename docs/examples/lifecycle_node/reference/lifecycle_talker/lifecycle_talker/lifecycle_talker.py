"""A managed node that counts while it is active."""

from __future__ import annotations

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.lifecycle.publisher import LifecyclePublisher
from rclpy.timer import Timer
from std_msgs.msg import Int64


class LifecycleTalker(LifecycleNode):
    """Publishes 1, 2, 3, ... on /count after each activation."""

    def __init__(self) -> None:
        """Declare the parameter; everything else is made by on_configure."""
        super().__init__('lifecycle_talker')
        self.declare_parameter('period', 0.2)
        self.count = 0
        self.publisher: LifecyclePublisher | None = None
        self.timer: Timer | None = None

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Create the publisher and the timer, if the period makes sense."""
        period = self.get_parameter('period').value
        if period <= 0.0:
            self.get_logger().error(f'the period must be positive, not {period}')
            return TransitionCallbackReturn.FAILURE
        self.publisher = self.create_lifecycle_publisher(Int64, 'count', 10)
        self.timer = self.create_timer(period, self.publish)
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Count from 1 again; the base class activates the publisher."""
        self.count = 0
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """The base class deactivates the publisher."""
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Destroy what on_configure created."""
        self.destroy_timer(self.timer)
        self.destroy_publisher(self.publisher)
        return TransitionCallbackReturn.SUCCESS

    def publish(self) -> None:
        """Publish the next number."""
        if self.publisher.is_activated:
            self.count += 1
            self.publisher.publish(Int64(data=self.count))


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = LifecycleTalker()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
