"""A node that sends a velocity command to the robot again and again."""

from __future__ import annotations

import rclpy
from geometry_msgs.msg import Twist
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

PERIOD_S = 0.3


class BotPublisher(Node):
    """Publishes a Twist on /cmd_vel every 300 ms."""

    def __init__(self) -> None:
        """Create the publisher and the timer."""
        super().__init__('bot_publisher')
        self.publisher = self.create_publisher(Twist, '/cmd_vel', 10)
        self.timer = self.create_timer(PERIOD_S, self.timer_callback)

    def timer_callback(self) -> None:
        """Publish the command: 1.0 m/s ahead while turning left at 0.5 rad/s."""
        message = Twist()
        message.linear.x = 1.0
        message.angular.z = 0.5
        self.publisher.publish(message)


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
