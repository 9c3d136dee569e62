"""Turtles on ROS topics: a thin layer that only converts messages and keeps time.

Like :mod:`sim.node` it needs no executor and does fixed steps: a command or a request acts from the
first step that begins after the middleware had received it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import rclpy
from geometry_msgs.msg import Twist
from rcl_interfaces.msg import IntegerRange, ParameterDescriptor
from rclpy.context import Context
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.validate_full_topic_name import validate_full_topic_name
from std_srvs.srv import Empty
from turtlesim.msg import Color
from turtlesim.msg import Pose as PoseMessage
from turtlesim.srv import Kill, SetPen, Spawn, TeleportAbsolute, TeleportRelative

from sim.motion import Pose
from sim.real_time import LateSink, RealTime
from sim.turtles.bounds import Colour
from sim.turtles.polling import Inbox, Request
from sim.turtles.rotating import RotationGoal, RotationServer
from sim.turtles.simulation import State, Step, Turtles
from sim.turtles.turtle import STEP_NS, Jump, Pen, Velocity

NODE = "turtlesim"
BACKGROUND: Colour = (69, 86, 255)
_DEPTH = 7
"""Depth of turtlesim's own queues."""
_COMMAND_DEPTH = 100
"""Longer than turtlesim's: commands wait here until a step begins."""
_LONGEST_NAME = 60


class Sink(LateSink, Protocol):
    """Receiver of the truth, such as a recording; called from the loop, so it must be quick."""

    def on_step(self, step: Step, stamp_ns: int) -> None:
        """Called after each step."""

    def on_answer(self, request: Request, response: Any) -> None:
        """Called before a request to a service of the turtles is answered."""


@dataclass
class _Interfaces:
    """The topics, services and the action of one turtle.

    Attributes:
        inputs: Subscriptions and services.
    """

    pose: Any
    colour: Any
    inputs: list[Any]
    rotation: RotationServer


class RosTurtles(RealTime):
    """Turtles that listen and publish."""

    def __init__(
        self,
        node: Node,
        turtles: Turtles,
        sink: Sink | None = None,
        steady_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        """Offer everything in a node of the caller, see :func:`make_node`; nothing moves yet."""
        super().__init__(node, sink, steady_ns, STEP_NS)
        self._turtles, self._sink = turtles, sink
        self._inbox = Inbox(node, self._on_answer)
        self._inbox.serve_own()
        self._inbox.serve(Spawn, "/spawn", self._spawn)
        self._inbox.serve(Kill, "/kill", self._kill)
        self._inbox.serve(Empty, "/clear", lambda request: self._do(request, turtles.clear))
        self._inbox.serve(Empty, "/reset", lambda request: self._do(request, turtles.reset))
        self._interfaces: dict[str, _Interfaces] = {}
        self.goals: list[RotationGoal] = []
        """Goals of the action rotate_absolute so far."""
        self._update_interfaces()

    @property
    def background(self) -> Colour:
        """The colour below the lines."""
        red, green, blue = (self._node.get_parameter(f"background_{one}").value for one in "rgb")
        return red, green, blue

    @property
    def services(self) -> frozenset[str]:
        """Names of what can be called."""
        return self._inbox.services

    def _take(self, now_ns: int) -> None:
        self._inbox.take(self._stamp_ns, now_ns)

    def _advance(self) -> None:
        self._inbox.act(self._turtles.time_ns)
        self._update_interfaces()
        self._publish(self._turtles.advance())

    def _publish(self, step: Step) -> None:
        if self._sink is not None:
            self._sink.on_step(step, self._stamp_ns + step.time_ns)
        for name, state in step.turtles.items():
            interfaces = self._interfaces[name]
            interfaces.rotation.tell()
            interfaces.pose.publish(_pose_message(state))
            red, green, blue = state.colour
            interfaces.colour.publish(Color(r=red, g=green, b=blue))

    def _update_interfaces(self) -> None:
        """Offer what belongs to each turtle that is there, and to no other."""
        for name in self._interfaces.keys() - self._turtles.turtles.keys():
            interfaces = self._interfaces.pop(name)
            # Who waits for a result must hear that it was aborted.
            interfaces.rotation.tell()
            for entity in (*interfaces.inputs, *interfaces.rotation.services):
                self._inbox.forget(entity)
            for publisher in (interfaces.pose, interfaces.colour, *interfaces.rotation.publishers):
                self._node.destroy_publisher(publisher)
        for name in self._turtles.turtles.keys() - self._interfaces.keys():
            self._interfaces[name] = self._offer(name)

    def _offer(self, name: str) -> _Interfaces:
        node, inbox, turtles = self._node, self._inbox, self._turtles

        def set_pen(request: Any) -> None:
            colour, width = (request.r, request.g, request.b), request.width or Pen().width
            turtles.set_pen(name, Pen(colour, width, is_down=not request.off))

        def teleport(request: Any) -> None:
            turtles.teleport(name, Jump(Pose(request.x, request.y, request.theta)))

        def move(request: Any) -> None:
            turtles.teleport(name, Jump(Pose(0.0, 0.0, request.angular), request.linear))

        def command(twist: Twist) -> None:
            # turtlesim hears linear.y too, if its parameter holonomic is true.
            left_m_s = twist.linear.y if node.get_parameter("holonomic").value else 0.0
            turtles.command(name, Velocity(twist.linear.x, left_m_s, twist.angular.z))

        def unless_killed(act: Callable[[Any], None]) -> Callable[[Any], None]:
            # What has arrived may act only after the turtle was killed.
            return lambda message: act(message) if name in turtles.turtles else None

        def serve(kind: Any, service: str, act: Callable[[Any], None]) -> Any:
            def answer(request: Request) -> None:
                self._do(request, lambda: unless_killed(act)(request.message))

            return inbox.serve(kind, f"/{name}/{service}", answer)

        inputs = [
            inbox.subscribe(Twist, f"/{name}/cmd_vel", _COMMAND_DEPTH, unless_killed(command)),
            serve(SetPen, "set_pen", set_pen),
            serve(TeleportAbsolute, "teleport_absolute", teleport),
            serve(TeleportRelative, "teleport_relative", move),
        ]
        rotation = RotationServer(
            node, inbox, name, lambda theta: turtles.rotate(name, theta), self.goals
        )
        pose = node.create_publisher(PoseMessage, f"/{name}/pose", _DEPTH)
        colour = node.create_publisher(Color, f"/{name}/color_sensor", _DEPTH)
        return _Interfaces(pose, colour, inputs, rotation)

    def _on_answer(self, request: Request, response: Any) -> None:
        if self._sink is not None:
            self._sink.on_answer(request, response)

    def _do(self, request: Request, act: Callable[[], None]) -> None:
        act()
        request.answer()

    def _spawn(self, request: Request) -> None:
        wanted = request.message
        name = ""
        if not wanted.name or _is_valid_name(wanted.name):
            name = self._turtles.spawn(Pose(wanted.x, wanted.y, wanted.theta), wanted.name)
        request.answer(Spawn.Response(name=name))

    def _kill(self, request: Request) -> None:
        self._turtles.kill(request.message.name)
        request.answer()


def make_node(context: Context) -> Node:
    """The node turtlesim with its parameters; it takes no arguments, and writes no log."""
    parameter: Any = Parameter  # rclpy is typed in parts only
    node: Any = rclpy.create_node(
        NODE,
        context=context,
        use_global_arguments=False,
        enable_rosout=False,
        parameter_overrides=[parameter("start_type_description_service", value=False)],
    )
    shades = [IntegerRange(from_value=0, to_value=255, step=1)]
    for letter, word, value in zip("rgb", ("Red", "Green", "Blue"), BACKGROUND, strict=True):
        text = f"{word} part of the background's colour"
        described = ParameterDescriptor(description=text, integer_range=shades)
        node.declare_parameter(f"background_{letter}", value, described)
    text = "Whether turtles obey linear.y too"
    node.declare_parameter("holonomic", False, ParameterDescriptor(description=text))
    found: Node = node
    return found


def _is_valid_name(name: str) -> bool:
    """Whether a turtle can have it: it becomes a part of the names of topics."""
    try:
        validate_full_topic_name(f"/{name}")
    except InvalidTopicNameException:
        return False
    return "/" not in name and len(name) <= _LONGEST_NAME


def _pose_message(state: State) -> PoseMessage:
    pose, velocity = state.pose, state.velocity
    return PoseMessage(
        x=pose.x_m,
        y=pose.y_m,
        theta=pose.yaw_rad,
        linear_velocity=velocity.speed_m_s,
        angular_velocity=velocity.turn_rad_s,
    )
