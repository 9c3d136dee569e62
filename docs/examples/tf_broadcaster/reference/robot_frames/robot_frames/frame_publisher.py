"""Broadcasts where the robot is, and publishes once what is fixed to it."""

import math

import rclpy
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from tf2_msgs.msg import TFMessage

from robot_frames.static_frames import StaticFrames, fixed


class FramePublisher(Node):
    """Says where the frames of the robot are."""

    def __init__(self) -> None:
        """Publish the static frames, and wait for odometry."""
        super().__init__('frame_publisher')
        self.static_frames = StaticFrames(
            self,
            [
                fixed(self, 'base_footprint', 'base_link', (0.0, 0.0, 0.01)),
                fixed(self, 'base_link', 'laser', (-0.032, 0.0, 0.172), math.pi),
            ],
        )
        self.publisher = self.create_publisher(TFMessage, '/tf', 10)
        self.subscription = self.create_subscription(Odometry, '/odom', self.broadcast, 10)

    def broadcast(self, odometry: Odometry) -> None:
        """Send the pose of the robot as a transform."""
        pose = odometry.pose.pose
        found = TransformStamped()
        found.header.stamp = odometry.header.stamp
        found.header.frame_id = 'odom'
        found.child_frame_id = 'base_footprint'
        found.transform.translation.x = pose.position.x
        found.transform.translation.y = pose.position.y
        found.transform.rotation = pose.orientation
        self.publisher.publish(TFMessage(transforms=[found]))


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = FramePublisher()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
