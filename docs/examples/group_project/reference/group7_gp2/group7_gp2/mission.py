"""An action client that drives several legs, one after another."""

import rclpy
from group7_interfaces.action import Drive
from rclpy.action import ActionClient
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.task import Future


class Mission(Node):
    """Sends a goal for each leg, after the result of the leg before."""

    def __init__(self) -> None:
        """Create the client, and send the first goal."""
        super().__init__('mission')
        self.legs = list(self.declare_parameter('legs', [0.4, 0.3]).value)
        self.total = 0.0
        self.client = ActionClient(self, Drive, '/group7/drive')
        self.client.wait_for_server()
        self.send()

    def send(self) -> None:
        """Send the next goal, or say that all is done."""
        if not self.legs:
            self.get_logger().info(f'mission complete: {self.total:.2f} m')
            return
        goal = Drive.Goal(distance=self.legs.pop(0))
        self.client.send_goal_async(goal).add_done_callback(self.take_answer)

    def take_answer(self, future: Future) -> None:
        """Wait for the result of a goal, if it was accepted."""
        handle = future.result()
        if not handle.accepted:
            self.get_logger().error('leg rejected')
            self.send()
            return
        handle.get_result_async().add_done_callback(self.take_result)

    def take_result(self, future: Future) -> None:
        """Log the result, and go on."""
        travelled = future.result().result.travelled
        self.total += travelled
        self.get_logger().info(f'leg done: {travelled:.2f} m')
        self.send()


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = Mission()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
