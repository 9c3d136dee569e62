"""A node that patrols: a client of a service and of an action."""

from action_msgs.msg import GoalStatus
from patrol_interfaces.action import Navigate
from patrol_interfaces.srv import GetWaypoint
import rclpy
from rclpy.action import ActionClient
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

LIMIT_S = 5.0
WORDS = {GoalStatus.STATUS_ABORTED: 'aborted', GoalStatus.STATUS_CANCELED: 'canceled'}


class Patrol(Node):
    """Ask for one waypoint after another, and drive there."""

    def __init__(self):
        """Wait for the servers, with a timer."""
        super().__init__('patrol')
        self.waypoints = self.create_client(GetWaypoint, 'get_waypoint')
        self.navigate = ActionClient(self, Navigate, 'navigate')
        self.number = 0
        self.goal = None
        self.limit = None
        self.start = self.create_timer(0.1, self.begin)

    def begin(self):
        """Start as soon as both servers are there."""
        if self.waypoints.service_is_ready() and self.navigate.server_is_ready():
            self.start.cancel()
            self.ask()

    def ask(self):
        """Ask for the next waypoint."""
        request = GetWaypoint.Request(number=self.number)
        self.waypoints.call_async(request).add_done_callback(self.take_waypoint)

    def take_waypoint(self, future):
        """Drive to the waypoint."""
        response = future.result()
        if not response.found:
            self.get_logger().info('the patrol is over')
            return
        goal = Navigate.Goal(pose=response.pose)
        future = self.navigate.send_goal_async(goal, feedback_callback=self.take_feedback)
        future.add_done_callback(self.take_acceptance)

    def take_feedback(self, message):
        """Show how far it is."""
        self.get_logger().debug(f'{message.feedback.distance_remaining:.2f} m')

    def take_acceptance(self, future):
        """Wait for the result, or go on."""
        self.goal = future.result()
        if not self.goal.accepted:
            self.get_logger().warning(f'waypoint {self.number} was rejected')
            self.go_on()
            return
        self.limit = self.create_timer(LIMIT_S, self.cancel)
        self.goal.get_result_async().add_done_callback(self.take_result)

    def cancel(self):
        """Cancel a goal that takes too long."""
        self.limit.cancel()
        self.goal.cancel_goal_async()

    def take_result(self, future):
        """Say how the goal ended."""
        self.limit.cancel()
        word = WORDS.get(future.result().status)
        if word is None:
            self.get_logger().info(f'waypoint {self.number} was reached')
        else:
            self.get_logger().warning(f'waypoint {self.number} was {word}')
        self.go_on()

    def go_on(self):
        """Go on with the next waypoint."""
        self.number += 1
        self.ask()


def main(args=None):
    """Run the node."""
    rclpy.init(args=args)
    node = Patrol()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
