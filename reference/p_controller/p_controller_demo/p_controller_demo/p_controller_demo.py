"""A node that drives to a goal with a proportional controller."""

from __future__ import annotations

import math

import rclpy
from geometry_msgs.msg import Quaternion, Twist
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

LINEAR_GAIN = 0.6
ANGULAR_GAIN = 1.5
MAX_LINEAR_M_S = 0.22
MAX_ANGULAR_RAD_S = 2.84


def yaw_of(q: Quaternion) -> float:
    """The heading of an orientation, in rad from -pi to pi."""
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))


def wrap(angle: float) -> float:
    """The same angle in the range from -pi to pi."""
    return math.atan2(math.sin(angle), math.cos(angle))


def clamp(value: float, limit: float) -> float:
    """The value, or the limit with its sign where it is beyond."""
    return max(-limit, min(limit, value))


class PController(Node):
    """Drives to goal_x, goal_y and then turns to goal_theta."""

    def __init__(self) -> None:
        """Read the goal, create the publisher and the subscription."""
        super().__init__('p_controller_demo')
        self.declare_parameter('goal_x', 1.0)
        self.declare_parameter('goal_y', 0.0)
        self.declare_parameter('goal_theta', 0.0)
        self.declare_parameter('goal_tolerance', 0.05)
        self.declare_parameter('angle_tolerance', 0.05)
        self.goal_x = self.get_parameter('goal_x').value
        self.goal_y = self.get_parameter('goal_y').value
        self.goal_theta = self.get_parameter('goal_theta').value
        self.goal_tolerance = self.get_parameter('goal_tolerance').value
        self.angle_tolerance = self.get_parameter('angle_tolerance').value
        self.arrived = False
        self.publisher = self.create_publisher(Twist, '/cmd_vel', 10)
        self.subscription = self.create_subscription(Odometry, '/odom', self.odom_callback, 10)

    def odom_callback(self, odometry: Odometry) -> None:
        """Compute and publish the command for where the robot is now."""
        position = odometry.pose.pose.position
        yaw = yaw_of(odometry.pose.pose.orientation)
        dx = self.goal_x - position.x
        dy = self.goal_y - position.y
        distance = math.hypot(dx, dy)
        command = Twist()
        if not self.arrived and distance > self.goal_tolerance:
            heading_error = wrap(math.atan2(dy, dx) - yaw)
            command.linear.x = clamp(LINEAR_GAIN * distance, MAX_LINEAR_M_S)
            command.angular.z = clamp(ANGULAR_GAIN * heading_error, MAX_ANGULAR_RAD_S)
        else:
            self.arrived = True
            theta_error = wrap(self.goal_theta - yaw)
            if abs(theta_error) > self.angle_tolerance:
                command.angular.z = clamp(ANGULAR_GAIN * theta_error, MAX_ANGULAR_RAD_S)
        self.publisher.publish(command)


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = PController()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
