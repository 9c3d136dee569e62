"""A node that says where the laser is."""

from __future__ import annotations

import math

import rclpy
from geometry_msgs.msg import TransformStamped
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from tf2_ros import StaticTransformBroadcaster

YAW = math.pi


class LaserFrame(Node):
    """Publishes the static transform from base_link to laser."""

    def __init__(self) -> None:
        """Publish it once: nodes that start later get it too."""
        super().__init__('laser_frame')
        self.broadcaster = StaticTransformBroadcaster(self)
        mount = TransformStamped()
        mount.header.stamp = self.get_clock().now().to_msg()
        mount.header.frame_id = 'base_link'
        mount.child_frame_id = 'laser'
        mount.transform.translation.x = -0.032
        mount.transform.translation.z = 0.172
        mount.transform.rotation.z = math.sin(YAW / 2.0)
        mount.transform.rotation.w = math.cos(YAW / 2.0)
        self.broadcaster.sendTransform(mount)


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = LaserFrame()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
