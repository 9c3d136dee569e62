"""Runs both robots."""

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from robot_classes.robots import Drone, Rover


def main() -> None:
    """Run them until Ctrl+C."""
    rclpy.init()
    executor = SingleThreadedExecutor()
    robots = [Rover('rover'), Drone('drone')]
    for robot in robots:
        executor.add_node(robot)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
