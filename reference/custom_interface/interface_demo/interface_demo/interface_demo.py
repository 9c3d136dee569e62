"""A node that publishes the state of the robot in a message of its own type."""

from __future__ import annotations

import math

import rclpy
from enpm702_msgs.msg import BotStatus
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node


class InterfaceDemo(Node):
    """Makes a BotStatus of every odometry message."""

    def __init__(self) -> None:
        """Create the parameter, the publisher and the subscription."""
        super().__init__('interface_demo')
        self.declare_parameter('model', BotStatus.BURGER)
        self.publisher = self.create_publisher(BotStatus, '/interface_demo', 10)
        self.subscription = self.create_subscription(
            Odometry, '/odom', self.odom_callback, 10
        )

    def odom_callback(self, odometry: Odometry) -> None:
        """Publish the state of the robot."""
        pose = odometry.pose.pose
        twist = odometry.twist.twist
        status = BotStatus()
        status.model = self.get_parameter('model').value
        status.pose.x = pose.position.x
        status.pose.y = pose.position.y
        status.pose.theta = yaw_of(pose.orientation)
        status.velocities = [twist.linear.x, twist.angular.z]
        self.publisher.publish(status)


def yaw_of(q) -> float:
    """Return the rotation of a quaternion about the z axis, in radians."""
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = InterfaceDemo()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
