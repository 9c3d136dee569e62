"""Draws a square with a turtle."""

import math

import rclpy
from geometry_msgs.msg import Twist
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from turtlesim.msg import Pose
from turtlesim.srv import SetPen

SIDE = 2.0
NEAR = 0.02
STRAIGHT = 0.01
GAIN = 2.0
LEAST_SPEED, MOST_SPEED = 0.1, 1.5


def wrap(angle):
    """The same angle from -pi to pi."""
    return math.atan2(math.sin(angle), math.cos(angle))


def limited(error):
    """A speed for an error: proportional, neither too slow nor too fast."""
    return math.copysign(min(max(abs(GAIN * error), LEAST_SPEED), MOST_SPEED), error)


class TurtleSquare(Node):
    """Drives from corner to corner."""

    def __init__(self):
        super().__init__('turtle_square')
        self.corners = None
        self.is_driving = False
        self.publisher = self.create_publisher(Twist, '/turtle1/cmd_vel', 10)
        self.client = self.create_client(SetPen, '/turtle1/set_pen')
        self.client.wait_for_service()
        pen = SetPen.Request(r=255, g=0, b=0, width=5, off=0)
        self.is_red = self.client.call_async(pen)
        self.create_subscription(Pose, '/turtle1/pose', self.move, 10)

    def move(self, pose):
        """Go on to the next corner."""
        if not self.is_red.done():
            return
        if self.corners is None:
            x, y = pose.x, pose.y
            self.corners = [(x + SIDE, y), (x + SIDE, y + SIDE), (x, y + SIDE), (x, y)]
        command = Twist()
        if self.corners:
            self.steer(command, pose)
        self.publisher.publish(command)

    def steer(self, command, pose):
        """Turn to the corner on the spot, then drive there."""
        dx, dy = self.corners[0][0] - pose.x, self.corners[0][1] - pose.y
        distance = math.hypot(dx, dy)
        error = wrap(math.atan2(dy, dx) - pose.theta)
        if not self.is_driving and abs(error) > STRAIGHT:
            command.angular.z = limited(error)
        elif distance > NEAR and abs(error) < math.pi / 2:
            self.is_driving = True
            command.linear.x = limited(distance)
        else:
            self.is_driving = False
            self.corners.pop(0)


def main():
    """Run the node until it is shut down."""
    rclpy.init()
    try:
        rclpy.spin(TurtleSquare())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == '__main__':
    main()
