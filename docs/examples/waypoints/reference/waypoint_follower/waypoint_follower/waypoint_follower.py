"""A node that drives to one waypoint after another."""

import math
from collections import deque

import rclpy
from geometry_msgs.msg import Quaternion, Twist
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from waypoint_msgs.msg import Waypoint

LINEAR_GAIN = 1.0
ANGULAR_GAIN = 2.0
MAX_LINEAR_M_S = 0.2
MAX_ANGULAR_RAD_S = 1.5
AHEAD_RAD = 0.3
HEADING_RAD = 0.05


def yaw_of(q: Quaternion) -> float:
    """Compute the heading of an orientation, in rad from -pi to pi."""
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))


def wrap(angle: float) -> float:
    """Return the same angle in the range from -pi to pi."""
    return math.atan2(math.sin(angle), math.cos(angle))


def turning(error: float) -> float:
    """Compute the rate of turn for a heading error."""
    return max(-MAX_ANGULAR_RAD_S, min(MAX_ANGULAR_RAD_S, ANGULAR_GAIN * error))


class WaypointFollower(Node):
    """Drive to the waypoints in the order in which they come."""

    def __init__(self) -> None:
        """Create the publishers and the subscriptions."""
        super().__init__('waypoint_follower')
        self.waypoints = deque()
        self.is_there = False
        self.publisher = self.create_publisher(Twist, '/cmd_vel', 10)
        self.reached = self.create_publisher(Waypoint, '/reached', 10)
        self.create_subscription(Waypoint, '/waypoints', self.take_waypoint, 10)
        self.create_subscription(Odometry, '/odom', self.take_odometry, 10)

    def take_waypoint(self, waypoint: Waypoint) -> None:
        """Keep a waypoint until its turn comes."""
        self.waypoints.append(waypoint)

    def take_odometry(self, odometry: Odometry) -> None:
        """Steer to the first waypoint that is left; without one, stand."""
        command = Twist()
        if self.waypoints:
            self.steer(command, odometry)
        self.publisher.publish(command)

    def steer(self, command: Twist, odometry: Odometry) -> None:
        """Fill in the command: first drive to the waypoint, then turn to its heading."""
        waypoint = self.waypoints[0]
        position = odometry.pose.pose.position
        yaw = yaw_of(odometry.pose.pose.orientation)
        dx, dy = waypoint.x - position.x, waypoint.y - position.y
        distance = math.hypot(dx, dy)
        if distance <= waypoint.tolerance:
            self.is_there = True
        if not self.is_there:
            error = wrap(math.atan2(dy, dx) - yaw)
            command.angular.z = turning(error)
            if abs(error) < AHEAD_RAD:
                command.linear.x = min(MAX_LINEAR_M_S, LINEAR_GAIN * distance)
            return
        error = wrap(waypoint.theta - yaw)
        if abs(error) > HEADING_RAD:
            command.angular.z = turning(error)
            return
        self.reached.publish(waypoint)
        self.waypoints.popleft()
        self.is_there = False


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = WaypointFollower()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
