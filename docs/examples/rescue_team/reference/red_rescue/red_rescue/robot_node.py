"""What all robots of the team have in common."""

from abc import ABC, abstractmethod

import rclpy
from geometry_msgs.msg import Twist
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.node import Node


class RobotNode(Node, ABC):
    """A robot that drives as fast as its class says."""

    def __init__(self, name: str) -> None:
        """Create the publisher and the timer."""
        super().__init__(name)
        self.publisher = self.create_publisher(Twist, 'cmd_vel', 10)
        self.create_timer(0.1, self.drive)

    @abstractmethod
    def speed(self) -> float:
        """Say how fast the robot drives now, in m/s."""

    def drive(self) -> None:
        """Command the speed."""
        command = Twist()
        command.linear.x = self.speed()
        self.publisher.publish(command)


def run(robot: type[RobotNode]) -> None:
    """Run a robot until it is interrupted."""
    rclpy.init()
    executor = MultiThreadedExecutor(num_threads=4)
    executor.add_node(robot())
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()
