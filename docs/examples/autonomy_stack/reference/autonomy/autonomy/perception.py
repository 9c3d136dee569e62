"""The perception layer: a managed node that finds the nearest obstacle ahead."""

from __future__ import annotations

import math

import rclpy
from geometry_msgs.msg import PointStamped
from rclpy.executors import ExternalShutdownException
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float64

AHEAD = math.pi
HALF_WIDTH = math.radians(30.0)


def off_ahead(angle: float) -> float:
    """Angle between a beam and the way ahead, from 0 to pi."""
    return abs(math.remainder(angle - AHEAD, 2.0 * math.pi))


class Perception(LifecycleNode):
    """Publishes the distance and the place of the nearest obstacle ahead, while it is active."""

    def __init__(self) -> None:
        """Create nothing yet: on_configure does."""
        super().__init__('perception')

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Create the publishers, which are silent until the node is active."""
        self.distances = self.create_lifecycle_publisher(Float64, '/obstacle/distance', 10)
        self.points = self.create_lifecycle_publisher(PointStamped, '/obstacle/point', 10)
        self.subscription = self.create_subscription(
            LaserScan, '/scan', self.scan_callback, qos_profile_sensor_data
        )
        return TransitionCallbackReturn.SUCCESS

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Destroy what on_configure created."""
        self.destroy_subscription(self.subscription)
        self.destroy_publisher(self.distances)
        self.destroy_publisher(self.points)
        return TransitionCallbackReturn.SUCCESS

    def scan_callback(self, scan: LaserScan) -> None:
        """Publish the nearest obstacle ahead."""
        beams = (
            (distance, scan.angle_min + index * scan.angle_increment)
            for index, distance in enumerate(scan.ranges)
            if scan.range_min <= distance <= scan.range_max
        )
        ahead = (beam for beam in beams if off_ahead(beam[1]) <= HALF_WIDTH)
        distance, angle = min(ahead, default=(math.inf, AHEAD))
        self.distances.publish(Float64(data=distance))
        if math.isfinite(distance):
            obstacle = PointStamped(header=scan.header)
            obstacle.point.x = distance * math.cos(angle)
            obstacle.point.y = distance * math.sin(angle)
            self.points.publish(obstacle)


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = Perception()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
