"""Starts the driver of a robot, and on demand the monitor."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.conditions import IfCondition
from launch.launch_description_sources import AnyLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments, and say what is started."""
    share = FindPackageShare('robot_bringup')
    return LaunchDescription([
        DeclareLaunchArgument('robot', default_value='robot1', description='Namespace'),
        DeclareLaunchArgument('speed', default_value='0.2', description='Speed in m/s'),
        DeclareLaunchArgument('monitor', default_value='false', description='Start the monitor'),
        Node(
            package='robot_bringup',
            executable='driver',
            namespace=LaunchConfiguration('robot'),
            parameters=[
                PathJoinSubstitution([share, 'config', 'driver.yaml']),
                {'speed': ParameterValue(LaunchConfiguration('speed'), value_type=float)},
            ],
            remappings=[('cmd_vel', 'base/cmd_vel')],
        ),
        IncludeLaunchDescription(
            AnyLaunchDescriptionSource(
                PathJoinSubstitution([share, 'launch', 'monitor.launch.xml'])
            ),
            launch_arguments={'robot': LaunchConfiguration('robot')}.items(),
            condition=IfCondition(LaunchConfiguration('monitor')),
        ),
    ])
