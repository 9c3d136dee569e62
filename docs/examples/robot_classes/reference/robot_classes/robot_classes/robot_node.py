"""What all robots have in common."""

from abc import ABC, abstractmethod

from rclpy.node import Node
from std_msgs.msg import Float64

PERIOD_S = 0.2


class RobotNode(Node, ABC):
    """A robot that moves step by step, and publishes how far it has moved."""

    def __init__(self, name: str) -> None:
        """Begin at rest."""
        super().__init__('robot', namespace=name)
        self.travelled = 0.0
        self.publisher = self.create_publisher(Float64, 'travelled', 10)
        self.timer = self.create_timer(PERIOD_S, self.step)

    @abstractmethod
    def move(self) -> float:
        """Move once; say how far, in m."""

    def step(self) -> None:
        """Move once, and publish the way so far."""
        self.travelled += self.move()
        self.publisher.publish(Float64(data=self.travelled))
