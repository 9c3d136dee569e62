"""Starts all layers of the stack."""

from launch import LaunchDescription
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    """Say what is started."""
    return LaunchDescription([
        Node(package='autonomy', executable='laser_frame'),
        Node(package='autonomy', executable='odom_frame'),
        Node(package='autonomy', executable='locator'),
        Node(package='autonomy', executable='perception'),
        Node(package='autonomy', executable='decision'),
    ])
