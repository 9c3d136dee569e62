"""Drives the robot to a goal ahead, and stops there."""

import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

GOAL_M = 1.0
SPEED_M_S = 0.25
NEAR_M = 0.02
GAIN_PER_S = 2.0


class Driver(Node):
    """Answers each message of odometry with a command."""

    def __init__(self):
        super().__init__('driver')
        self.publisher = self.create_publisher(Twist, '/cmd_vel', 10)
        self.create_subscription(Odometry, '/odom', self.drive, 10)

    def drive(self, odometry):
        """Drive on, slower near the goal, and stop there."""
        left = GOAL_M - odometry.pose.pose.position.x
        command = Twist()
        if left > NEAR_M:
            command.linear.x = min(SPEED_M_S, GAIN_PER_S * left)
        self.publisher.publish(command)


def main():
    """Run the node until Ctrl-C."""
    try:
        rclpy.init()
        rclpy.spin(Driver())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
