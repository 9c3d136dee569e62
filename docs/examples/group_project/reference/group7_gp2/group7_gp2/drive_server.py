"""An action server that drives the robot straight ahead."""

import math
import time

import rclpy
from geometry_msgs.msg import Twist
from group7_interfaces.action import Drive
from nav_msgs.msg import Odometry
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.node import Node
from std_srvs.srv import Trigger

STEP_S = 0.1
LONGEST_M = 2.0


def is_possible(distance: float) -> bool:
    """Whether the robot can drive so far ahead, in m."""
    return 0.0 < distance <= LONGEST_M


class DriveServer(Node):
    """Offers the action drive in the namespace of the group."""

    def __init__(self) -> None:
        """Create the action server, the publisher and the subscription."""
        super().__init__('drive_server')
        self.speed = self.declare_parameter('speed', 0.2).value
        self.position: tuple[float, float] | None = None
        self.reached = 0
        group = ReentrantCallbackGroup()
        self.publisher = self.create_publisher(Twist, '/cmd_vel', 10)
        self.create_subscription(Odometry, '/odom', self.locate, 10, callback_group=group)
        self.create_service(Trigger, '/group7/reached', self.count, callback_group=group)
        self.server = ActionServer(
            self,
            Drive,
            '/group7/drive',
            execute_callback=self.execute,
            goal_callback=self.decide,
            cancel_callback=self.cancel,
            callback_group=group,
        )

    def locate(self, odometry: Odometry) -> None:
        """Keep where the robot is."""
        point = odometry.pose.pose.position
        self.position = (point.x, point.y)

    def count(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Say how many goals were reached."""
        response.success = True
        response.message = str(self.reached)
        return response

    def decide(self, goal: Drive.Goal) -> GoalResponse:
        """Accept a distance of up to 2 m ahead."""
        return GoalResponse.ACCEPT if is_possible(goal.distance) else GoalResponse.REJECT

    def cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        """Agree to cancel."""
        return CancelResponse.ACCEPT

    def drive(self, speed: float) -> None:
        """Command a speed."""
        command = Twist()
        command.linear.x = speed
        self.publisher.publish(command)

    def execute(self, handle: ServerGoalHandle) -> Drive.Result:
        """Drive until the distance is reached, or the goal is canceled."""
        result = Drive.Result()
        feedback = Drive.Feedback()
        while self.position is None:
            time.sleep(STEP_S)
        start = self.position
        while result.travelled < handle.request.distance:
            if handle.is_cancel_requested:
                self.drive(0.0)
                handle.canceled()
                return result
            self.drive(self.speed)
            time.sleep(STEP_S)
            result.travelled = math.dist(start, self.position)
            feedback.remaining = max(0.0, handle.request.distance - result.travelled)
            handle.publish_feedback(feedback)
        self.drive(0.0)
        self.reached += 1
        handle.succeed()
        return result


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = DriveServer()
    executor = MultiThreadedExecutor(num_threads=4)
    executor.add_node(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
