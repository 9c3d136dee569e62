"""A node that sends one velocity command to the robot."""

from __future__ import annotations

import rclpy
from geometry_msgs.msg import Twist
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node


class BotPublisher(Node):
    """Publishes one Twist on /cmd_vel when it starts."""

    def __init__(self) -> None:
        """Create the publisher and publish the command."""
        super().__init__('bot_publisher')
        self.publisher = self.create_publisher(Twist, '/cmd_vel', 10)
        self.publish_command()

    def publish_command(self) -> None:
        """Publish the command: 1.0 m/s ahead while turning left at 0.5 rad/s."""
        message = Twist()
        message.linear.x = 1.0
        message.angular.z = 0.5
        self.publisher.publish(message)
        self.get_logger().info(
            f'published linear.x={message.linear.x}, angular.z={message.angular.z}'
        )


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = BotPublisher()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
