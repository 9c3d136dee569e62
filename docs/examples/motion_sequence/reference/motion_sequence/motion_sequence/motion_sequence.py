"""A node that drives a sequence of legs and turns, and then ends."""

import math
from typing import NamedTuple

import rclpy
from geometry_msgs.msg import Twist
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.task import Future

PERIOD_S = 0.05
SPEED_M_S = 0.2
TURN_RAD_S = math.radians(45.0)


class Motion(NamedTuple):
    """A command, and how long it lasts."""

    linear_m_s: float
    angular_rad_s: float
    duration_s: float


def leg(length_m: float) -> Motion:
    """Drive straight ahead."""
    return Motion(SPEED_M_S, 0.0, length_m / SPEED_M_S)


def turn(angle_deg: float) -> Motion:
    """Turn on the spot, to the left where the angle is positive."""
    angle_rad = math.radians(angle_deg)
    return Motion(0.0, math.copysign(TURN_RAD_S, angle_rad), abs(angle_rad) / TURN_RAD_S)


SEQUENCE = (leg(0.6), turn(90.0), leg(0.4), turn(-90.0), leg(0.4), Motion(0.0, 0.0, 1.0))


class MotionSequence(Node):
    """Drive the sequence by a timer."""

    def __init__(self) -> None:
        """Create the publisher and the timer."""
        super().__init__('motion_sequence')
        self.done = Future()
        self.began = None
        self.publisher = self.create_publisher(Twist, '/cmd_vel', 10)
        self.timer = self.create_timer(PERIOD_S, self.step)

    def step(self) -> None:
        """Publish the command for this moment."""
        now = self.get_clock().now()
        if self.began is None:
            self.began = now
        elapsed_s = (now - self.began).nanoseconds / 1e9
        command = Twist()
        for motion in SEQUENCE:
            if elapsed_s < motion.duration_s:
                command.linear.x = motion.linear_m_s
                command.angular.z = motion.angular_rad_s
                break
            elapsed_s -= motion.duration_s
        else:
            self.timer.cancel()
            self.done.set_result(True)
        self.publisher.publish(command)


def main(args: list[str] | None = None) -> None:
    """Run the node until the sequence is complete."""
    rclpy.init(args=args)
    node = MotionSequence()
    try:
        rclpy.spin_until_future_complete(node, node.done)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
