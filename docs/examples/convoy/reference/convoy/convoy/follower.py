"""Follows the robot ahead at a distance of half a metre."""

import rclpy
from geometry_msgs.msg import Twist
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import LaserScan

DISTANCE_M = 0.5
GAIN_PER_S = 2.0
SPEED_M_S = 0.22
BEAMS = 15


class Follower(Node):
    """Drives tb2 by what its laser sees straight ahead."""

    def __init__(self) -> None:
        super().__init__('follower')
        self.publisher = self.create_publisher(Twist, '/tb2/cmd_vel', 10)
        self.create_subscription(LaserScan, '/tb2/scan', self.scanned, 10)

    def scanned(self, scan: LaserScan) -> None:
        """Drive as fast as the robot ahead is too far away; backwards where it is too near."""
        ahead = min([*scan.ranges[:BEAMS], *scan.ranges[-BEAMS:]])
        command = Twist()
        if ahead < scan.range_max:
            speed = GAIN_PER_S * (ahead - DISTANCE_M)
            command.linear.x = min(max(speed, -SPEED_M_S), SPEED_M_S)
        self.publisher.publish(command)


def main() -> None:
    """Run the node until it is interrupted."""
    rclpy.init()
    try:
        rclpy.spin(Follower())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
