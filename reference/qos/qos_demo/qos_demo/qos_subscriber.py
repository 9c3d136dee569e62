"""A node that gets the last messages even if it joins late."""

from __future__ import annotations

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Int64


class QosSubscriber(Node):
    """Logs every number that it receives."""

    def __init__(self) -> None:
        """Create the subscription."""
        super().__init__('qos_subscriber')
        profile = QoSProfile(
            reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL,
            history=HistoryPolicy.KEEP_LAST,
            depth=10,
        )
        self.subscription = self.create_subscription(
            Int64, '/qos_demo', self.message_callback, profile
        )

    def message_callback(self, message: Int64) -> None:
        """Log the number."""
        self.get_logger().info(f'Received: {message.data}')


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = QosSubscriber()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
