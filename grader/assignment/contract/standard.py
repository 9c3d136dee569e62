"""The standard checks: what a contract says of a part of the ROS graph, and how it is judged.

Each :class:`~grader.assignment.contract.spot.Fact` is one line of what a contract can say. A new
one is an entry here and a field of the model.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from grader.assignment.contract.model import (
    Connection,
    Contract,
    Declared,
    Interface,
    Part,
    Program,
    Publication,
    Server,
    Subscription,
)
from grader.assignment.contract.spot import ANY, Asked, Fact, Spot, period_of
from grader.findings.words import Words
from grader.spec.document import Place

_CONSTANT = re.compile(r"^\s*[\w/\[\]<=]+\s+[A-Z]\w*\s*=", re.MULTILINE)
"""A constant in the definition of an interface, such as ``int8 OFF=0``."""


# What the checks of these facts are asked, where that takes more than an expression.


def _package(spot: Spot) -> Asked:
    asked: dict[str, Any] = {"package": spot.package}
    if spot.of_package.interfaces:
        asked["build_type"] = spot.of_package.build_type[0]
    return {**asked, "remap": True}


def _built(spot: Spot) -> Asked:
    return {"package": spot.package} if spot.of_package.executables else None


def _executable(spot: Spot) -> Asked:
    asked: dict[str, Any] = {"package": spot.package, "executable": spot.executable}
    if len(spot.of_package.executables) == 1:
        asked["remap"] = True
    return asked


def _node(spot: Spot) -> Asked:
    if spot.program.node == ANY:
        return None
    asked = {"name": spot.program.node}
    if spot.program.publishes:
        asked["publishes"] = next(iter(spot.program.publishes))
    return asked


def _ends(spot: Spot) -> Asked:
    return {"within": spot.program.ends} if spot.program.ends else None


def _of_topic(spot: Spot, parameters: Mapping[str, Any]) -> Asked:
    return {"topic": spot.name, **parameters} if parameters else None


def _depth(spot: Spot) -> Asked:
    part = spot.part_as(Connection)
    kind = "subscription" if isinstance(part, Subscription) else "publisher"
    return {"topic": spot.name, "depth": part.depth, "kind": kind} if part.depth else None


def _sent(spot: Spot) -> Asked:
    part = spot.part_as(Publication)
    is_asked_more = part.value or part.period or part.rate or part.count
    return {"topic": spot.name, "at_least": 1} if is_asked_more else None


def _count(spot: Spot) -> Asked:
    count = spot.part_as(Publication).count
    return {"topic": spot.name, "exactly": count} if count else None


def _value(spot: Spot) -> Asked:
    value = spot.part_as(Publication).value
    return {"topic": spot.name, "value": value} if value else None


def _left_alone(spot: Spot) -> Asked:
    topics = spot.program.leaves_alone
    if topics == "robot":
        # The check knows the robot's topics.
        return {}
    return {"topics": list(topics)} if topics else None


def _not_subscribed(spot: Spot) -> Asked:
    topics = list(spot.program.does_not_subscribe)
    return {"topics": topics} if topics else None


def _asked_server(spot: Spot) -> Asked:
    return {"server": spot.name, "more": True}


def _declaration(spot: Spot) -> Asked:
    said = spot.part_as(Declared).model_dump(exclude_unset=True, exclude={"ids"}, mode="json")
    return {"node": spot.program.node, "name": spot.name, **said}


def _definition(spot: Spot) -> dict[str, Any]:
    return {"interface": spot.interface, "definition": spot.part_as(Interface).definition}


def _constants(spot: Spot) -> Asked:
    asked = _definition(spot)
    return asked if _CONSTANT.search(asked["definition"]) else None


def _name_hint(end: str) -> Words:
    """What to compare where a publisher or a subscription is not on its topic."""
    hint = "The {} argument of create_{} is the name of the topic."
    hint += " `ros2 topic list` shows all topics."
    return Words(hint.format("second", end), hint.format("first", end))


PACKAGE = (
    Fact(
        "package",
        "package.found",
        _package,
        "The package {package} is there",
        Words(
            "Create it with `ros2 pkg create --build-type ament_python {package}`.",
            "Create it with `ros2 pkg create --build-type ament_cmake {package} --dependencies "
            "rclcpp`.",
        ),
    ),
    Fact(
        "builds",
        "package.builds",
        _built,
        "The package{of_package} builds with colcon",
        "Run `colcon build` in your workspace (the folder above src) and read its first error.",
        requires=("package",),
        requires_in_depends=("generated",),
    ),
    Fact(
        "dependencies",
        "package.dependencies",
        _built,
        "package.xml{of_package} names every ROS package that the code uses",
        Words(
            "Write one `<depend>` in package.xml for every ROS package that you import.",
            "Write one `<depend>` in package.xml, and one find_package(...) in CMakeLists.txt, for "
            "every ROS package whose headers you include.",
        ),
        requires=("builds",),
    ),
)

PROGRAM = (
    Fact(
        "executable",
        "package.executable",
        _executable,
        "`ros2 run {package} {executable}` finds the executable",
        Words(
            "The line in setup.py is '{executable} = {package}.{module}:main': the name of the "
            "executable, the module in your package, the function in the module.",
            "CMakeLists.txt needs add_executable({executable} src/your_file.cpp), "
            "ament_target_dependencies({executable} rclcpp ...) and install(TARGETS {executable} "
            "DESTINATION lib/${{PROJECT_NAME}}).",
        ),
        requires=("builds",),
        weight=2,
        is_before_runs=True,
    ),
    Fact(
        "starts",
        "node.starts",
        lambda spot: {},
        "{program} starts and creates a node",
        "Run `ros2 run {package} {executable}` yourself and read the last lines that it prints.",
        requires=("executable",),
    ),
    Fact(
        "node",
        "node.exists",
        _node,
        "The node {whose}is called {node}",
        Words(
            "The name of the node is the argument of super().__init__() in its class.",
            "The name of the node is the argument of Node(...) in the constructor of its class.",
        ),
        requires=("starts",),
    ),
    Fact(
        "alive",
        "node.alive",
        lambda spot: {} if spot.program.alive else None,
        "{subject} stays alive",
        Words(
            "rclpy.spin(node) keeps the node running until it is interrupted.",
            "rclcpp::spin(node) keeps the node running until it is interrupted.",
        ),
        requires=("starts",),
    ),
    Fact(
        "ends",
        "node.ends",
        _ends,
        "{subject} ends by itself within {ends} of Ctrl+C",
        Words(
            "Ctrl+C ends rclpy.spin() with a KeyboardInterrupt. Do not catch it and go on.",
            "Ctrl+C makes rclcpp::spin() return. Do not start another loop after it, and install "
            "no handler of SIGINT.",
        ),
        requires=("alive",),
    ),
)

PUBLICATION = (
    Fact(
        "topic",
        "topic.published",
        lambda spot: {"topic": spot.name, "remap": True},
        "{subject} publishes on {name}",
        _name_hint("publisher"),
        requires=("starts",),
        weight=2,
    ),
    Fact(
        "type",
        "topic.type",
        lambda spot: {"topic": spot.name, "type": spot.part_as(Connection).type},
        "The topic {name} carries {type}",
        Words(
            "The first argument of create_publisher is the class of the messages.",
            "The type of the messages stands in angle brackets: "
            "create_publisher<package::msg::Type>(...).",
        ),
        requires=("topic",),
        weight=2,
        may_take_remap_over=True,
    ),
    Fact(
        "qos",
        "qos.offered",
        lambda spot: _of_topic(spot, spot.part_as(Connection).qos),
        "The publisher{on} is {qos}",
        Words(
            "Give a queue size instead of a QoSProfile. Then you get the default, which is right "
            "here.",
            "Give a queue size instead of an rclcpp::QoS. Then you get the default, which is right "
            "here.",
        ),
        requires=("topic",),
    ),
    Fact(
        "depth",
        "qos.depth",
        _depth,
        "The queue of the publisher{on} holds {depth} messages",
        Words(
            "The third argument of create_publisher is the queue size.",
            "The second argument of create_publisher is the queue size.",
        ),
        requires=("topic",),
    ),
    Fact(
        "sent",
        "messages.count",
        _sent,
        "Messages arrive{on}",
        Words(
            "Call self.publisher.publish(message) in the callback of the timer. Call "
            "rclpy.spin(node), which calls the callback.",
            "Call publisher_->publish(message) in the callback of the timer. Call "
            "rclcpp::spin(node), which calls the callback.",
        ),
        requires=("type",),
        weight=2,
    ),
    Fact(
        "once",
        "messages.count",
        _count,
        "Exactly {count} {are} published{on}",
        "Publish neither in a loop nor in a timer that goes on.",
        requires=("sent",),
        weight=4,
    ),
    Fact(
        "values",
        "messages.equal",
        _value,
        "Every message{on} has {value}",
        "Set the fields before you publish; all others keep their default of 0.",
        requires=("sent",),
        weight=4,
    ),
    Fact(
        "period",
        "timing.period",
        lambda spot: _of_topic(spot, period_of(spot.part_as(Publication))),
        "A message comes every {period}{on}",
        "`ros2 topic hz {name}` shows the rate.",
        requires=("sent", "alive"),
        weight=8,
    ),
    Fact(
        "rate",
        "timing.rate",
        lambda spot: _of_topic(spot, spot.part_as(Publication).rate),
        "Messages come with {rate}{on}",
        "`ros2 topic hz {name}` shows the rate.",
        requires=("sent", "alive"),
        weight=4,
    ),
    Fact(
        "timer",
        "executor.timer",
        lambda spot: {"topic": spot.name} if spot.part_as(Publication).timer else None,
        "A timer calls the callback{on}, not a thread or a loop",
        Words(
            "Create a timer with self.create_timer(period_in_seconds, self.timer_callback), and "
            "publish in its callback.",
            "Create a timer with timer_ = this->create_wall_timer(period, callback), and publish "
            "in its callback.",
        ),
        requires=("sent", "responsive"),
        weight=4,
    ),
)

SUBSCRIPTION = (
    Fact(
        "subscribes",
        "topic.subscribed",
        lambda spot: {"topic": spot.name, "remap": True},
        "{subject} subscribes to {name}",
        _name_hint("subscription"),
        requires=("starts",),
        weight=2,
    ),
    Fact(
        "subscribed_type",
        "topic.type",
        lambda spot: {
            "topic": spot.name,
            "type": spot.part_as(Connection).type,
            "kind": "subscription",
        },
        "The subscription to {name} is of {type}",
        Words(
            "The first argument of create_subscription is the class of the messages.",
            "The type of the messages stands in angle brackets: "
            "create_subscription<package::msg::Type>(...).",
        ),
        requires=("subscribes",),
        weight=2,
        may_take_remap_over=True,
    ),
    Fact(
        "subscribed_qos",
        "qos.requested",
        lambda spot: _of_topic(spot, spot.part_as(Connection).qos),
        "The subscription to {name} is {qos}",
        Words(
            "A queue size or qos_profile_sensor_data is right here.",
            "A queue size or rclcpp::SensorDataQoS() is right here.",
        ),
        requires=("subscribes",),
    ),
    Fact(
        "subscribed_depth",
        "qos.depth",
        _depth,
        "The queue of the subscription to {name} holds {depth} messages",
        Words(
            "The fourth argument of create_subscription, after the callback, is the queue size.",
            "The second argument of create_subscription, before the callback, is the queue size.",
        ),
        requires=("subscribes",),
    ),
)

AFTERWARDS = (
    Fact(
        "responsive",
        "executor.responsive",
        lambda spot: spot.program.responsive or None,
        "The callbacks {whose}do not block the executor",
        "Do not loop or sleep in a callback: let it do its work once, and return.",
        requires=("sent", "alive"),
        weight=4,
    ),
    Fact(
        "untouched",
        "topic.untouched",
        _left_alone,
        "{subject} does not publish on the robot's own topics",
        "Only the robot publishes its sensors. Your node only subscribes to them.",
        requires=("starts",),
    ),
    Fact(
        "not_subscribed",
        "topic.not_subscribed",
        _not_subscribed,
        "{subject} does not subscribe to what is not for it",
        "What it needs comes from another node.",
        requires=("starts",),
    ),
)
"""Facts of a program that build on those of its topics."""

SERVICE = (
    Fact(
        "service",
        "service.exists",
        lambda spot: {"service": spot.name, "type": spot.part_as(Server).type, "remap": True},
        "{subject} offers the service {name}",
        Words(
            "self.create_service({short}, '{name}', self.callback); `ros2 service list -t` shows "
            "it.",
            'create_service<{cpp_type}>("{name}", callback); `ros2 service list -t` shows it.',
        ),
        requires=("node",),
        weight=2,
    ),
)

ACTION = (
    Fact(
        "action",
        "action.exists",
        lambda spot: {"action": spot.name, "type": spot.part_as(Server).type, "remap": True},
        "{subject} offers the action {name}",
        Words(
            "ActionServer(self, {short}, '{name}', self.execute); `ros2 action list -t` shows it.",
            'rclcpp_action::create_server<{cpp_type}>(this, "{name}", ...); `ros2 action list '
            "-t` shows it.",
        ),
        requires=("node",),
        weight=2,
    ),
)


CALL = (
    Fact(
        "calls",
        "client.asks",
        _asked_server,
        "{subject} calls the service {name}",
        Words(
            "self.create_client({short}, '{name}').call_async(request) sends a request.",
            'create_client<{cpp_type}>("{name}")->async_send_request(request) sends a request.',
        ),
        requires=("starts",),
        weight=2,
    ),
)

SENT_GOAL = (
    Fact(
        "sends_goals",
        "client.asks",
        _asked_server,
        "{subject} sends a goal to the action {name}",
        Words(
            "ActionClient(self, {short}, '{name}').send_goal_async(goal) sends a goal.",
            'rclcpp_action::create_client<{cpp_type}>(this, "{name}")->async_send_goal(goal) sends '
            "a goal.",
        ),
        requires=("starts",),
        weight=2,
    ),
)

PARAMETER = (
    Fact(
        "parameter",
        "parameter.declared",
        _declaration,
        "The parameter {name} is declared",
        Words(
            "self.declare_parameter('{name}', default) in the constructor.",
            'this->declare_parameter("{name}", default) in the constructor.',
        ),
        requires=("node",),
        weight=2,
    ),
)

INTERFACE = (
    Fact(
        "definition",
        "interface.found",
        lambda spot: {"interface": spot.interface, "remap": True},
        "The definition is in {file}",
        "Its folder is beside package.xml, and the file has the name of the interface.",
        requires=("package",),
    ),
    Fact(
        "fields",
        "interface.fields",
        _definition,
        "{interface} has the fields that are asked for",
        "Two programs can communicate only if they have the same definition.",
        requires=("definition",),
        weight=4,
    ),
    Fact(
        "constants",
        "interface.constants",
        _constants,
        "{interface} has the constants that are asked for",
        "A constant has a name in upper case and an equals sign.",
        requires=("definition",),
        weight=4,
    ),
    Fact(
        "generated",
        "interface.generated",
        lambda spot: {"interface": spot.interface},
        "The build generates {interface}",
        "After `colcon build` and sourcing, `ros2 interface show {interface}` works.",
        requires=("definition",),
    ),
    Fact(
        "manifest",
        "interface.manifest",
        lambda spot: {"interface": spot.interface},
        "package.xml{of_package} declares that the package holds interfaces",
        (
            "Your machine has these packages already. Another machine installs only the packages "
            "that package.xml names."
        ),
        requires=("generated",),
    ),
)


def spots(contract: Contract) -> Iterator[tuple[Spot, Sequence[Fact]]]:
    """The parts of a contract in their order, each with what can be said of it.

    Packages of interfaces come first: the others are built on them.
    """
    packages = sorted(contract.packages.items(), key=lambda item: not item[1].interfaces)
    for name, package in packages:
        place: Place = ("contract", "packages", name)
        spot = Spot(contract, place, package, name, name)
        yield spot, PACKAGE
        for inner, interface in package.interfaces.items():
            inside = (*place, "interfaces", inner)
            yield Spot(contract, inside, interface, inner, name, around=(spot,)), INTERFACE
        for executable, program in package.executables.items():
            yield from _of_program(spot, executable, program)


def _of_program(
    package: Spot, name: str, program: Program
) -> Iterator[tuple[Spot, Sequence[Fact]]]:
    contract, place = package.contract, (*package.place, "executables", name)
    spot = Spot(contract, place, program, name, package.package, name, (package,))
    yield spot, PROGRAM
    groups: tuple[tuple[str, Mapping[str, Part], Sequence[Fact]], ...] = (
        ("publishes", program.publishes, PUBLICATION),
        ("subscribes", program.subscribes, SUBSCRIPTION),
        ("serves", program.serves, SERVICE),
        ("actions", program.actions, ACTION),
        ("calls", program.calls, CALL),
        ("sends_goals", program.sends_goals, SENT_GOAL),
        ("parameters", program.parameters, PARAMETER),
    )
    around = (spot, package)
    for key, parts, facts in groups:
        for inner, part in parts.items():
            inside = (*place, key, inner)
            yield Spot(contract, inside, part, inner, package.package, name, around), facts
    yield spot, AFTERWARDS
