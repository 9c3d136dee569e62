"""The robots."""

from robot_classes.robot_node import RobotNode


class Rover(RobotNode):
    """Drives on wheels."""

    def move(self) -> float:
        """Drive."""
        return 0.1


class Drone(RobotNode):
    """Flies."""

    def move(self) -> float:
        """Fly."""
        return 0.25
