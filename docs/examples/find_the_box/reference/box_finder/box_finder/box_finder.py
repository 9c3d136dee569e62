"""A node that looks around for a red box, drives to it, and stops before it."""

import numpy as np
import rclpy
from geometry_msgs.msg import Twist
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import Image, LaserScan

SPEED_M_S = 0.18
SEARCH_RAD_S = 0.6
GAIN = 1.0
STOP_M = 0.4
LEAST_PIXELS = 15


def red_pixels(image: Image) -> np.ndarray:
    """Find the pixels that are much more red than green and blue, as true and false."""
    pixels = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, 3)
    red, green, blue = np.moveaxis(pixels.astype(float), 2, 0)
    return (red > 60) & (red > 2.0 * green) & (red > 2.0 * blue)


class BoxFinder(Node):
    """Turn until the box is in sight, then drive towards it."""

    def __init__(self) -> None:
        """Create the publisher and the subscriptions."""
        super().__init__('box_finder')
        self.ahead_m = float('inf')
        self.is_there = False
        self.publisher = self.create_publisher(Twist, '/cmd_vel', 10)
        self.create_subscription(LaserScan, '/scan', self.take_scan, 10)
        self.create_subscription(Image, '/camera/image_raw', self.take_image, 10)

    def take_scan(self, scan: LaserScan) -> None:
        """Keep how far the nearest thing ahead is."""
        beams = np.array(scan.ranges)
        self.ahead_m = min(beams[:10].min(), beams[-10:].min())

    def take_image(self, image: Image) -> None:
        """Search, approach or stop."""
        command = Twist()
        columns = np.nonzero(red_pixels(image))[1]
        is_seen = columns.size >= LEAST_PIXELS
        if is_seen and self.ahead_m < STOP_M:
            self.is_there = True
        if self.is_there:
            pass
        elif is_seen:
            half = 0.5 * (image.width - 1)
            error = (half - columns.mean()) / half
            command.linear.x = SPEED_M_S * (1.0 - abs(error))
            command.angular.z = GAIN * error
        else:
            command.angular.z = SEARCH_RAD_S
        self.publisher.publish(command)


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = BoxFinder()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
