"""A simulator as a course may have one: an ordinary node that moves a robot and says where it is.

Tests install it as a program of a package of its own.
"""

import math
import sys
import time

import rclpy
from geometry_msgs.msg import PoseStamped, Twist
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Bool

STEP_S = 0.01
WALL_M = 1.0


class SmallSimulator(Node):
    """Moves as commanded along a plane with a wall at x = 1 m, in steps of simulated time."""

    def __init__(self) -> None:
        super().__init__("small_simulator")
        self.rate = self.declare_parameter("rate", 1.0).value
        self.fails_after_s = self.declare_parameter("fails_after", math.inf).value
        self.silent_after_s = self.declare_parameter("silent_after", math.inf).value
        self.slow_after_s = self.declare_parameter("slow_after", math.inf).value
        self.x = self.y = self.yaw = self.time_s = 0.0
        self.steps = 0
        self.command = Twist()
        self.create_subscription(Twist, "cmd_vel", self.obey, 10)
        self.pose = self.create_publisher(PoseStamped, "model/pose", 10)
        self.clock = self.create_publisher(Clock, "/clock", 10)
        self.bumper = self.create_publisher(Bool, "bumper", 10)
        self.began_s = time.monotonic()
        self.create_timer(STEP_S, self.catch_up)

    def obey(self, command: Twist) -> None:
        """Keep the newest command."""
        self.command = command

    def catch_up(self) -> None:
        """All steps that are due: a busy machine slows no time down."""
        while self.steps * STEP_S < time.monotonic() - self.began_s:
            self.step()

    def step(self) -> None:
        """One step, and what is told of it."""
        self.steps += 1
        real_s = self.steps * STEP_S
        if real_s > self.fails_after_s:
            print("the physics exploded", file=sys.stderr)
            sys.exit(3)
        step_s = STEP_S * (0.1 if real_s > self.slow_after_s else self.rate)
        self.time_s += step_s
        way_m = self.command.linear.x * step_s
        self.yaw += self.command.angular.z * step_s
        self.x = min(self.x + way_m * math.cos(self.yaw), WALL_M)
        self.y += way_m * math.sin(self.yaw)
        clock = Clock()
        clock.clock.sec = int(self.time_s)
        clock.clock.nanosec = int(self.time_s % 1.0 * 1e9)
        self.clock.publish(clock)
        if real_s > self.silent_after_s:
            return
        pose = PoseStamped()
        pose.header.stamp, pose.header.frame_id = clock.clock, "world"
        pose.pose.position.x, pose.pose.position.y = self.x, self.y
        pose.pose.orientation.z = math.sin(self.yaw / 2)
        pose.pose.orientation.w = math.cos(self.yaw / 2)
        self.pose.publish(pose)
        if self.steps % 5 == 0:
            self.bumper.publish(Bool(data=self.x >= WALL_M))


if __name__ == "__main__":
    rclpy.init()
    rclpy.spin(SmallSimulator())
