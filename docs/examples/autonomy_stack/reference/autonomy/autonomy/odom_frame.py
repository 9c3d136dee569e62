"""A node that says where the robot is."""

from __future__ import annotations

import rclpy
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from tf2_ros import TransformBroadcaster


class OdomFrame(Node):
    """Broadcasts the pose of the odometry as the transform from odom to base_link."""

    def __init__(self) -> None:
        """Create the broadcaster and the subscription."""
        super().__init__('odom_frame')
        self.broadcaster = TransformBroadcaster(self)
        self.subscription = self.create_subscription(Odometry, '/odom', self.odom_callback, 10)

    def odom_callback(self, odometry: Odometry) -> None:
        """Broadcast the pose, with the stamp of the odometry."""
        pose = odometry.pose.pose
        base = TransformStamped()
        base.header.stamp = odometry.header.stamp
        base.header.frame_id = 'odom'
        base.child_frame_id = 'base_link'
        base.transform.translation.x = pose.position.x
        base.transform.translation.y = pose.position.y
        base.transform.translation.z = pose.position.z
        base.transform.rotation = pose.orientation
        self.broadcaster.sendTransform(base)


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = OdomFrame()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
