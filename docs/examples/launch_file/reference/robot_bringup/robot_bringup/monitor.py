"""A node that tells how fast a robot drives."""

from __future__ import annotations

import rclpy
from geometry_msgs.msg import Twist
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import Float64


class Monitor(Node):
    """Publishes the speed of every velocity command."""

    def __init__(self) -> None:
        """Create the publisher and the subscription."""
        super().__init__('monitor')
        self.publisher = self.create_publisher(Float64, 'speed', 10)
        self.subscription = self.create_subscription(Twist, 'cmd_vel', self.command_callback, 10)

    def command_callback(self, command: Twist) -> None:
        """Publish its speed."""
        self.publisher.publish(Float64(data=command.linear.x))


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = Monitor()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
