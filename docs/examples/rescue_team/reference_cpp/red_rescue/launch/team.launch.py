"""Starts the whole team."""

from launch import LaunchDescription
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    """Describe all robots."""
    return LaunchDescription(
        [
            Node(package='red_rescue', executable='scout', namespace='north'),
            Node(package='red_rescue', executable='scout', namespace='south'),
            Node(package='red_rescue', executable='medic'),
        ]
    )
