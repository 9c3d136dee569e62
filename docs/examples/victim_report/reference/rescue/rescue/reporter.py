"""Reports the victims that a robot finds."""

import rclpy
from rclpy.node import Node
from rescue_msgs.msg import VictimReport

PLACES = [(1.0, 0.5, 0.2), (3.0, -1.0, 0.9), (-2.0, 4.0, 0.5)]


class Reporter(Node):
    """Reports one victim after the other."""

    def __init__(self):
        """Create the publisher and the timer."""
        super().__init__('reporter')
        self.publisher = self.create_publisher(VictimReport, '/victims', 10)
        self.timer = self.create_timer(0.5, self.report)
        self.reported = 0

    def report(self):
        """Report the next victim."""
        x, y, severity = PLACES[self.reported % len(PLACES)]
        message = VictimReport(severity=severity, note=f'victim {self.reported}')
        message.pose.position.x = x
        message.pose.position.y = y
        self.publisher.publish(message)
        self.reported += 1


def main(args=None):
    """Run the node."""
    rclpy.init(args=args)
    node = Reporter()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
