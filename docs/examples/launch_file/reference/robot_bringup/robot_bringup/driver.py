"""A node that drives."""

from __future__ import annotations

import rclpy
from geometry_msgs.msg import Twist
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

PERIOD_S = 0.1


class Driver(Node):
    """Publishes the same velocity command again and again."""

    def __init__(self) -> None:
        """Create the publisher and the timer."""
        super().__init__('driver')
        self.declare_parameter('speed', 0.2)
        self.declare_parameter('turn', 0.0)
        self.publisher = self.create_publisher(Twist, 'cmd_vel', 10)
        self.timer = self.create_timer(PERIOD_S, self.timer_callback)

    def timer_callback(self) -> None:
        """Publish the command."""
        message = Twist()
        message.linear.x = self.get_parameter('speed').value
        message.angular.z = self.get_parameter('turn').value
        self.publisher.publish(message)


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = Driver()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
