"""Spawns turtles and catches them."""

import math

import rclpy
from geometry_msgs.msg import Twist
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.parameter import Parameter
from turtlesim.msg import Pose
from turtlesim.srv import Kill, Spawn

CAUGHT = 0.4
AHEAD = 0.2
LINEAR_GAIN, MOST_LINEAR = 1.5, 2.0
ANGULAR_GAIN, MOST_ANGULAR = 4.0, 3.0


def wrap(angle):
    """The same angle from -pi to pi."""
    return math.atan2(math.sin(angle), math.cos(angle))


class TurtleCatch(Node):
    """Hunts the nearest turtle."""

    def __init__(self):
        super().__init__('turtle_catch')
        self.declare_parameter('places', Parameter.Type.DOUBLE_ARRAY)
        places = self.get_parameter('places').value
        self.prey = {}
        self.target = None
        self.kill = self.create_client(Kill, '/kill')
        self.spawn = self.create_client(Spawn, '/spawn')
        self.spawn.wait_for_service()
        self.missing = len(places) // 2
        for number, (x, y) in enumerate(zip(places[::2], places[1::2]), start=1):
            request = Spawn.Request(x=x, y=y, theta=0.0, name=f'prey{number}')
            self.prey[request.name] = (x, y)
            self.spawn.call_async(request).add_done_callback(self.spawned)
        self.publisher = self.create_publisher(Twist, '/turtle1/cmd_vel', 10)
        self.create_subscription(Pose, '/turtle1/pose', self.hunt, 10)

    def spawned(self, future):
        """One more is there."""
        self.missing -= 1

    def hunt(self, pose):
        """Drive to the target, and choose the next one when it is caught."""
        command = Twist()
        if self.missing == 0 and self.prey:
            self.target = self.target or min(self.prey, key=lambda one: self.distance(pose, one))
            if self.distance(pose, self.target) < CAUGHT:
                self.catch()
            else:
                self.steer(command, pose)
        self.publisher.publish(command)

    def distance(self, pose, name):
        """How far a turtle is."""
        x, y = self.prey[name]
        return math.hypot(x - pose.x, y - pose.y)

    def catch(self):
        """Kill the target."""
        self.kill.call_async(Kill.Request(name=self.target))
        del self.prey[self.target]
        self.target = None

    def steer(self, command, pose):
        """Turn to the target, and drive when it is ahead."""
        x, y = self.prey[self.target]
        error = wrap(math.atan2(y - pose.y, x - pose.x) - pose.theta)
        turn = ANGULAR_GAIN * error
        command.angular.z = math.copysign(min(abs(turn), MOST_ANGULAR), turn)
        if abs(error) < AHEAD:
            command.linear.x = min(LINEAR_GAIN * self.distance(pose, self.target), MOST_LINEAR)


def main():
    """Run the node until it is shut down."""
    rclpy.init()
    try:
        rclpy.spin(TurtleCatch())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == '__main__':
    main()
