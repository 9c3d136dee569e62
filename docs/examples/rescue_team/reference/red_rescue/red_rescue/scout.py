"""A robot that looks for victims."""

from red_interfaces.msg import VictimReport
from red_rescue.robot_node import RobotNode, run

VICTIMS = [(1.0, 0.5, 0.2), (3.0, -1.0, 0.9), (-2.0, 4.0, 0.5)]


class Scout(RobotNode):
    """Drives on, and reports one victim after the other."""

    def __init__(self) -> None:
        """Create the publisher of the reports, and their timer."""
        super().__init__('scout')
        self.reports = self.create_publisher(VictimReport, '/victims', 10)
        self.create_timer(0.5, self.report)
        self.reported = 0

    def speed(self) -> float:
        """Drive slowly, so that no victim is missed."""
        return 0.2

    def report(self) -> None:
        """Report the next victim."""
        x, y, severity = VICTIMS[self.reported % len(VICTIMS)]
        message = VictimReport(severity=severity)
        message.pose.position.x = x
        message.pose.position.y = y
        self.reports.publish(message)
        self.reported += 1


def main() -> None:
    """Run the node."""
    run(Scout)
