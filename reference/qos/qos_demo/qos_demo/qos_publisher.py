"""A node that counts, and keeps its last messages for whoever joins late."""

from __future__ import annotations

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Int64

PERIOD_S = 0.5


class QosPublisher(Node):
    """Publishes 0, 1, 2 and so on."""

    def __init__(self) -> None:
        """Create the publisher and the timer."""
        super().__init__('qos_publisher')
        self.count = 0
        profile = QoSProfile(
            reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL,
            history=HistoryPolicy.KEEP_LAST,
            depth=10,
        )
        self.publisher = self.create_publisher(Int64, '/qos_demo', profile)
        self.timer = self.create_timer(PERIOD_S, self.timer_callback)

    def timer_callback(self) -> None:
        """Publish the next number."""
        message = Int64()
        message.data = self.count
        self.publisher.publish(message)
        self.count += 1


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = QosPublisher()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
