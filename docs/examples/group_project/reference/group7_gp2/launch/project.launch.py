"""Starts the server and the mission."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    """Describe both nodes, and the speed as an argument."""
    speed = DeclareLaunchArgument('speed', default_value='0.2', description='Speed in m/s.')
    server = Node(
        package='group7_gp2',
        executable='drive_server',
        parameters=[{'speed': LaunchConfiguration('speed')}],
    )
    mission = Node(
        package='group7_gp2',
        executable='mission',
        parameters=[{'legs': [0.5, 0.4]}],
    )
    return LaunchDescription([speed, server, mission])
