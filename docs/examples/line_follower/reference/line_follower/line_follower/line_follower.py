"""A node that follows a dark line on the floor by the pictures of a camera."""

import numpy as np
import rclpy
from geometry_msgs.msg import Twist
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import Image

SPEED_M_S = 0.18
GAIN = 2.0
LEAST_PIXELS = 20


def dark_pixels(image: Image) -> np.ndarray:
    """Find the pixels that are much darker than the floor, as an array of true and false."""
    pixels = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, 3)
    brightness = pixels.mean(axis=2)
    return brightness < 0.5 * np.median(brightness)


class LineFollower(Node):
    """Keep the middle of the line in the middle of the picture."""

    def __init__(self) -> None:
        """Create the publisher and the subscription."""
        super().__init__('line_follower')
        self.publisher = self.create_publisher(Twist, '/cmd_vel', 10)
        self.create_subscription(Image, '/camera/image_raw', self.take_image, 10)

    def take_image(self, image: Image) -> None:
        """Steer towards the line; stop where there is none."""
        command = Twist()
        # The lower half shows the floor right before the robot.
        dark = dark_pixels(image)[image.height // 2:]
        columns = np.nonzero(dark)[1]
        if columns.size >= LEAST_PIXELS:
            half = 0.5 * (image.width - 1)
            error = (half - columns.mean()) / half
            command.linear.x = SPEED_M_S * (1.0 - 0.5 * abs(error))
            command.angular.z = GAIN * error
        self.publisher.publish(command)


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = LineFollower()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
