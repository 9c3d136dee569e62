"""A node that drives ahead and stops in front of an obstacle."""

from __future__ import annotations

import rclpy
from geometry_msgs.msg import Twist
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import LaserScan

SPEED_M_S = 0.1
STOP_DISTANCE_M = 0.2
SCAN_TIMEOUT_S = 1.0
WATCHDOG_PERIOD_S = 0.1


class BotController(Node):
    """Drives at 0.1 m/s until the front beam of /scan sees an obstacle at 0.2 m."""

    def __init__(self) -> None:
        """Create the publisher, the subscription and the watchdog."""
        super().__init__('bot_controller')
        self.last_scan = None
        self.publisher = self.create_publisher(Twist, '/cmd_vel', 10)
        self.subscription = self.create_subscription(LaserScan, '/scan', self.scan_callback, 10)
        self.watchdog = self.create_timer(WATCHDOG_PERIOD_S, self.watchdog_callback)

    def scan_callback(self, scan: LaserScan) -> None:
        """Drive or stop, by what the front beam measured."""
        self.last_scan = self.get_clock().now()
        front = scan.ranges[0]
        # A beam that met nothing reports inf, on the real LDS-01 0.0: neither is an obstacle.
        # Nearer than range_min it reports -inf (REP-117), and that is one.
        if front != 0.0 and front <= STOP_DISTANCE_M:
            self.drive(0.0)
        else:
            self.drive(SPEED_M_S)

    def watchdog_callback(self) -> None:
        """Stop when no scan has come for a while: the robot would drive blindly."""
        if self.last_scan is None:
            return
        silence = self.get_clock().now() - self.last_scan
        if silence.nanoseconds > SCAN_TIMEOUT_S * 1e9:
            self.drive(0.0)

    def drive(self, speed: float) -> None:
        """Publish a command to drive ahead at a speed in m/s."""
        message = Twist()
        message.linear.x = speed
        self.publisher.publish(message)


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = BotController()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
