"""Frames that are fixed to others."""

import math

from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from tf2_msgs.msg import TFMessage


def fixed(
    node: Node,
    parent: str,
    child: str,
    position: tuple[float, float, float],
    yaw: float = 0.0,
) -> TransformStamped:
    """Make the transform of a frame that is turned about the z axis only."""
    found = TransformStamped()
    found.header.stamp = node.get_clock().now().to_msg()
    found.header.frame_id = parent
    found.child_frame_id = child
    found.transform.translation.x = position[0]
    found.transform.translation.y = position[1]
    found.transform.translation.z = position[2]
    found.transform.rotation.z = math.sin(yaw / 2.0)
    found.transform.rotation.w = math.cos(yaw / 2.0)
    return found


class StaticFrames:
    """Publishes static transforms, as tf2_ros.StaticTransformBroadcaster does."""

    def __init__(self, node: Node, frames: list[TransformStamped]) -> None:
        """Publish all of them at once; nodes that start later get them too."""
        qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.publisher = node.create_publisher(TFMessage, '/tf_static', qos)
        self.publisher.publish(TFMessage(transforms=frames))
