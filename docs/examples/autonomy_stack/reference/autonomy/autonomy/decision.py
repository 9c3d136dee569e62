"""The decision layer: a managed node that drives the robot."""

from __future__ import annotations

import rclpy
from geometry_msgs.msg import Twist
from rclpy.executors import ExternalShutdownException
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from std_msgs.msg import Float64

FREE_M = 0.6
STOP_M = 0.3
SPEED_M_S = 0.2
TURN_RAD_S = 0.5


def decide(distance: float) -> Twist:
    """Drive while the way is free, else turn left; stop if the obstacle is too near."""
    command = Twist()
    if distance > FREE_M:
        command.linear.x = SPEED_M_S
    elif distance >= STOP_M:
        command.angular.z = TURN_RAD_S
    return command


class Decision(LifecycleNode):
    """Publishes a command for each distance, while it is active."""

    def __init__(self) -> None:
        """Create nothing yet: on_configure does."""
        super().__init__('decision')

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Create the publisher, which is silent until the node is active."""
        self.commands = self.create_lifecycle_publisher(Twist, '/cmd_vel', 10)
        self.subscription = self.create_subscription(
            Float64, '/obstacle/distance', self.distance_callback, 10
        )
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the robot before the publisher falls silent."""
        self.commands.publish(Twist())
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Destroy what on_configure created."""
        self.destroy_subscription(self.subscription)
        self.destroy_publisher(self.commands)
        return TransitionCallbackReturn.SUCCESS

    def distance_callback(self, message: Float64) -> None:
        """Publish the command for a distance."""
        self.commands.publish(decide(message.data))


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = Decision()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
