"""A small simulator: a round robot on a plane, with a wall at x = 1.5 m, and simulated time."""

import math
import time

import rclpy
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Bool

STEP_S = 0.01
WALL_M = 1.5
RADIUS_M = 0.1
MAX_SPEED_M_S = 0.3


class Simulator(Node):
    """Moves the robot as commanded, and says where it is."""

    def __init__(self):
        super().__init__('simulator')
        self.x = self.y = self.yaw = 0.0
        self.steps = 0
        self.command = Twist()
        self.create_subscription(Twist, 'cmd_vel', self.obey, 10)
        self.truth = self.create_publisher(PoseStamped, 'model/pose', 10)
        self.odometry = self.create_publisher(Odometry, 'odom', 10)
        self.bumper = self.create_publisher(Bool, 'bumper', 10)
        self.clock = self.create_publisher(Clock, 'clock', 10)
        self.began_s = time.monotonic()
        self.create_timer(STEP_S, self.catch_up)

    def obey(self, command):
        """Keep the newest command."""
        self.command = command

    def catch_up(self):
        """Do all steps that are due: a busy machine does not slow time down."""
        while self.steps * STEP_S < time.monotonic() - self.began_s:
            self.step()

    def step(self):
        """Move on, and publish what is new."""
        self.steps += 1
        speed = max(-MAX_SPEED_M_S, min(self.command.linear.x, MAX_SPEED_M_S))
        self.yaw += self.command.angular.z * STEP_S
        self.x = min(self.x + speed * math.cos(self.yaw) * STEP_S, WALL_M - RADIUS_M)
        self.y += speed * math.sin(self.yaw) * STEP_S
        clock = Clock()
        clock.clock.sec, hundredths = divmod(self.steps, 100)
        clock.clock.nanosec = hundredths * 10_000_000
        self.clock.publish(clock)
        pose = PoseStamped()
        pose.header.stamp, pose.header.frame_id = clock.clock, 'world'
        pose.pose.position.x, pose.pose.position.y = self.x, self.y
        pose.pose.orientation.z = math.sin(self.yaw / 2.0)
        pose.pose.orientation.w = math.cos(self.yaw / 2.0)
        self.truth.publish(pose)
        if self.steps % 4 == 0:
            odometry = Odometry()
            odometry.header.stamp, odometry.header.frame_id = clock.clock, 'odom'
            odometry.child_frame_id = 'base_footprint'
            odometry.pose.pose = pose.pose
            odometry.twist.twist.linear.x = speed
            odometry.twist.twist.angular.z = self.command.angular.z
            self.odometry.publish(odometry)
            self.bumper.publish(Bool(data=self.x >= WALL_M - RADIUS_M))


def main():
    """Simulate until Ctrl-C."""
    try:
        rclpy.init()
        rclpy.spin(Simulator())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
