"""Publishes where the camera is on a robot that publishes its other frames itself."""

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from robot_frames.static_frames import StaticFrames, fixed


class CameraMount(Node):
    """Says where the camera is."""

    def __init__(self) -> None:
        """Publish the frame once."""
        super().__init__('camera_mount')
        self.static_frames = StaticFrames(
            self, [fixed(self, 'base_link', 'camera_link', (0.06, 0.0, 0.1))]
        )


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = CameraMount()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
