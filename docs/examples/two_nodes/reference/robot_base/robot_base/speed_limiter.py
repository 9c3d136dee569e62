"""A node that keeps a robot below a speed limit."""

from __future__ import annotations

import rclpy
from geometry_msgs.msg import Twist
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node


class SpeedLimiter(Node):
    """Passes velocity commands on, none of them faster than the limit."""

    def __init__(self) -> None:
        """Create the publisher and the subscription."""
        super().__init__('speed_limiter')
        self.declare_parameter('limit', 0.22)
        self.publisher = self.create_publisher(Twist, 'cmd_vel', 10)
        self.subscription = self.create_subscription(
            Twist, 'cmd_vel_raw', self.command_callback, 10
        )

    def command_callback(self, command: Twist) -> None:
        """Pass a command on."""
        limit = self.get_parameter('limit').value
        command.linear.x = min(max(command.linear.x, -limit), limit)
        self.publisher.publish(command)


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = SpeedLimiter()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
