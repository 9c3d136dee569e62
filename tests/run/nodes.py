"""Sources of student nodes for the tests of the runner: real rclpy, each with one trait."""

from __future__ import annotations

HEADER = """\
import os, signal, subprocess, sys, threading, time
import rclpy
from geometry_msgs.msg import Twist, Vector3
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy


def twist(x=1.0):
    message = Twist()
    message.linear.x = x
    message.angular.z = 0.5
    return message
"""

ONE_SHOT = (
    HEADER
    + """
class BotPublisher(Node):
    def __init__(self):
        super().__init__("bot_publisher")
        self.publisher = self.create_publisher(Twist, "cmd_vel", 10)
        self.publisher.publish(twist())

rclpy.init()
node = BotPublisher()
rclpy.spin(node)
"""
)

ONE_SHOT_THEN_EXIT = ONE_SHOT.replace(
    "rclpy.spin(node)\n", "node.destroy_node()\nrclpy.shutdown()\n"
)


def timed(
    period_s: float = 0.05,
    value: float = 1.0,
    topic: str = "/cmd_vel",
    interface: str = "Twist",
    qos: str = "10",
    before_spin: str = "pass",
    callback: str = "",
) -> str:
    """A node that publishes from a timer."""
    message = f"twist({value})" if interface == "Twist" else f"{interface}()"
    callback = callback or f"self.publisher.publish({message})"
    return (
        HEADER
        + f"""
class BotPublisher(Node):
    def __init__(self):
        super().__init__("bot_publisher")
        self.publisher = self.create_publisher({interface}, "{topic}", {qos})
        self.timer = self.create_timer({period_s}, self.publish)

    def publish(self):
        {callback}

rclpy.init()
node = BotPublisher()
{before_spin}
rclpy.spin(node)
"""
    )


BLOCKED = (
    HEADER
    + """
class BotPublisher(Node):
    def __init__(self):
        super().__init__("bot_publisher")
        self.publisher = self.create_publisher(Twist, "/cmd_vel", 10)
        while True:
            self.publisher.publish(twist())
            time.sleep(0.05)

rclpy.init()
rclpy.spin(BotPublisher())
"""
)

HANGS_AT_IMPORT = HEADER + "\nwhile True:\n    time.sleep(1)\n"
SEGFAULT = HEADER + "\nrclpy.init()\nos.kill(os.getpid(), signal.SIGSEGV)\n"
RAISES = HEADER + "\nrclpy.init()\nraise RuntimeError('no robot here')\n"
FLOOD = "import os\nblock = b'x' * 2**20 + b'\\n'\nfor _ in range(1024):\n    os.write(1, block)\n"
