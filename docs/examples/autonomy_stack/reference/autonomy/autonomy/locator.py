"""A node that says where the obstacle is in the odom frame."""

from __future__ import annotations

import rclpy
from geometry_msgs.msg import Point, PointStamped, Transform
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.time import Time
from tf2_ros import Buffer, TransformException, TransformListener


def transformed(point: Point, transform: Transform) -> Point:
    """Turn a point by the rotation of a transform, then move it by its translation."""
    q, t = transform.rotation, transform.translation
    # v + 2 w (q x v) + 2 q x (q x v)
    x = 2.0 * (q.y * point.z - q.z * point.y)
    y = 2.0 * (q.z * point.x - q.x * point.z)
    z = 2.0 * (q.x * point.y - q.y * point.x)
    return Point(
        x=t.x + point.x + q.w * x + q.y * z - q.z * y,
        y=t.y + point.y + q.w * y + q.z * x - q.x * z,
        z=t.z + point.z + q.w * z + q.x * y - q.y * x,
    )


class Locator(Node):
    """Transforms the nearest obstacle from the frame of the laser to odom."""

    def __init__(self) -> None:
        """Create the listener, the publisher and the subscription."""
        super().__init__('locator')
        self.buffer = Buffer()
        self.listener = TransformListener(self.buffer, self)
        self.publisher = self.create_publisher(PointStamped, '/obstacle/in_odom', 10)
        self.subscription = self.create_subscription(
            PointStamped, '/obstacle/point', self.point_callback, 10
        )

    def point_callback(self, obstacle: PointStamped) -> None:
        """Publish the obstacle in odom, once the frames are known."""
        try:
            found = self.buffer.lookup_transform('odom', obstacle.header.frame_id, Time())
        except TransformException as error:
            self.get_logger().info(f'no transform yet: {error}', throttle_duration_sec=1.0)
            return
        located = PointStamped()
        located.header = found.header
        located.point = transformed(obstacle.point, found.transform)
        self.publisher.publish(located)


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = Locator()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
