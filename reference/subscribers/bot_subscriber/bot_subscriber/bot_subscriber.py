"""A node that listens to the robot's odometry and to its LiDAR."""

from __future__ import annotations

import rclpy
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import LaserScan


class BotSubscriber(Node):
    """Logs the robot's position and the distance to the obstacle ahead."""

    def __init__(self) -> None:
        """Create the two subscriptions."""
        super().__init__('bot_subscriber')
        self.odom_subscription = self.create_subscription(
            Odometry, '/odom', self.odom_callback, 10
        )
        self.scan_subscription = self.create_subscription(
            LaserScan, '/scan', self.scan_callback, 10
        )

    def odom_callback(self, message: Odometry) -> None:
        """Log where the robot is, in metres."""
        position = message.pose.pose.position
        self.get_logger().info(f'Position: x = {position.x:.2f}, y = {position.y:.2f}')

    def scan_callback(self, message: LaserScan) -> None:
        """Log the front range: beam 0 looks straight ahead."""
        self.get_logger().info(f'Front range: {message.ranges[0]:.2f}')


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = BotSubscriber()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
