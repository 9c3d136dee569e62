"""The standard checks: what a contract says of a part of the ROS graph, and how it is judged.

Each :class:`Fact` is one line of what a contract can say. A new one is an entry here and a field of
the model.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

from grader.assignment.contract.model import (
    Connection,
    Contract,
    ContractPackage,
    Declared,
    Interface,
    Part,
    Program,
    Publication,
    Server,
    Subscription,
)
from grader.findings.fields import each_field, wanted_words
from grader.findings.text import is_asked_of_text
from grader.findings.words import Words, listing
from grader.spec.document import Place

ANY = "any"
_P = TypeVar("_P", bound=Part)


@dataclass(frozen=True)
class Fact:
    """A thing that a contract says of a part, and the standard check of it.

    Attributes:
        name: Its id, before the prefix of its part.
        asked: The parameters of the check, or None where the contract does not say it.
        requires: Facts whose checks must pass first, of this part or of those around it.
        weight: Its share of the points, where the contract gives only their sum.
    """

    name: str
    uses: str
    asked: Callable[[Spot], dict[str, Any] | None]
    title: str
    hint: str | Words
    requires: tuple[str, ...] = ()
    weight: int = 1


@dataclass(frozen=True)
class Spot:
    """A part of a contract with its name and all that it lies in.

    Attributes:
        name: Of a topic, a service, an interface ...; of a program or a package its own name.
        around: The parts that it lies in, the innermost first.
    """

    contract: Contract
    place: Place
    part: Part
    name: str
    package: str
    executable: str = ""
    around: tuple[Spot, ...] = field(default=(), repr=False)

    def part_as(self, kind: type[_P]) -> _P:
        """The part, which is of this kind."""
        assert isinstance(self.part, kind)
        return self.part

    @property
    def of_package(self) -> ContractPackage:
        """The package that it lies in."""
        return self.contract.packages[self.package]

    @property
    def program(self) -> Program:
        """The program that it lies in."""
        return self.of_package.executables[self.executable]

    @property
    def interface(self) -> str:
        """The full name of an interface, such as ``bot_msgs/msg/BotStatus``."""
        return f"{self.package}/{self.name}"

    @cached_property
    def words(self) -> Mapping[str, str]:
        """What stands in the places of titles and hints."""
        several = len(self.contract.programs) > 1
        short = str(getattr(self.part, "type", "")).rpartition("/")[2]
        found = {
            "package": self.package,
            "executable": self.executable,
            "name": self.name,
            "whose": f"of {self.executable} " if several and self.executable else "",
            "subject": self.executable if several and self.executable else "The node",
            "program": self.executable if several and self.executable else "The program",
            "of_package": f" {self.package}" if len(self.contract.packages) > 1 else "",
            "type": str(getattr(self.part, "type", "")),
            "short": short,
            "cpp_type": str(getattr(self.part, "type", "")).replace("/", "::"),
        }
        if self.executable:
            alone = len(self.of_package.executables) == 1
            found["module"] = module_of(self.package, self.executable, alone=alone)
            found["node"], found["ends"] = self.program.node, str(self.program.ends)
        if isinstance(self.part, Connection):
            found["qos"] = listing(value.replace("_", " ") for value in self.part.qos.values())
            found["depth"] = str(self.part.depth)
        if isinstance(self.part, Publication):
            found["on"] = f" on {self.name}" if len(self.program.publishes) > 1 else ""
            found["count"] = (
                "one message" if self.part.count == 1 else f"{self.part.count} messages"
            )
            found["are"] = "is" if self.part.count == 1 else "are"
            found["period"] = str(period_of(self.part).get("period"))
            found["rate"] = rate_words(self.part)
            found["value"] = listing(
                f"{name}{' that' if is_asked_of_text(value) else ''} {wanted_words(value)}"
                for name, value in each_field(self.part.value)
            )
        if isinstance(self.part, Interface):
            found["interface"] = self.interface
            found["file"] = f"{self.name}.{self.name.split('/')[0]}"
        return found


def module_of(package: str, executable: str, *, alone: bool) -> str:
    """The module of a program: called like its package if it is the only one in it."""
    return package if alone else re.sub(r"\W", "_", executable.removesuffix(".py"))


def period_of(part: Publication) -> dict[str, Any]:
    """The parameters of ``timing.period``; none where the contract says no period."""
    if part.period is None:
        return {}
    return part.period if isinstance(part.period, dict) else {"period": part.period}


def rate_words(part: Publication) -> str:
    """How often messages come, such as ``at least 9 Hz and at most 11 Hz``."""
    limits = {"at_least": "at least", "at_most": "at most"}
    return listing(f"{text} {part.rate[key]}" for key, text in limits.items() if key in part.rate)


def _found(spot: Spot) -> dict[str, Any]:
    if spot.of_package.interfaces:
        build_type = spot.of_package.build_type[0]
        return {"package": spot.package, "build_type": build_type, "remap": True}
    return {"package": spot.package, "remap": True}


def _executable(spot: Spot) -> dict[str, Any]:
    asked: dict[str, Any] = {"package": spot.package, "executable": spot.executable}
    return {**asked, "remap": True} if len(spot.of_package.executables) == 1 else asked


def _node(spot: Spot) -> dict[str, Any] | None:
    if spot.program.node == ANY:
        return None
    topics = list(spot.program.publishes)
    return {"name": spot.program.node, **({"publishes": topics[0]} if topics else {})}


def _qos(spot: Spot) -> dict[str, Any] | None:
    asked = spot.part_as(Connection).qos
    return {"topic": spot.name, **asked} if asked else None


def _depth(spot: Spot) -> dict[str, Any] | None:
    part = spot.part_as(Connection)
    kind = "subscription" if isinstance(part, Subscription) else "publisher"
    return {"topic": spot.name, "depth": part.depth, "kind": kind} if part.depth else None


def _name_hint(end: str) -> Words:
    """What to compare where a publisher or a subscription is not on its topic."""
    hint = "The {} argument of create_{} is the name of the topic."
    hint += " `ros2 topic list` shows all topics."
    return Words(hint.format("second", end), hint.format("first", end))


def _sent(spot: Spot) -> dict[str, Any] | None:
    part = spot.part_as(Publication)
    counts = part.value or part.period or part.rate or part.count
    return {"topic": spot.name, "at_least": 1} if counts else None


def _declared(spot: Spot) -> dict[str, Any]:
    assert isinstance(spot.part, Declared)
    said = spot.part.model_dump(exclude_unset=True, exclude={"ids"}, mode="json")
    return {"node": spot.program.node, "name": spot.name, **said}


def _definition(spot: Spot) -> dict[str, Any]:
    assert isinstance(spot.part, Interface)
    return {"interface": spot.interface, "definition": spot.part.definition}


def _constants(spot: Spot) -> dict[str, Any] | None:
    asked = _definition(spot)
    return (
        asked if re.search(r"^\s*[\w/\[\]<=]+\s+[A-Z]\w*\s*=", asked["definition"], re.M) else None
    )


PACKAGE = (
    Fact(
        "package",
        "package.found",
        _found,
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
        lambda it: {"package": it.package} if it.of_package.executables else None,
        "The package{of_package} builds with colcon",
        "Run `colcon build` in your workspace (the folder above src) and read its first error.",
        ("package", "generated"),
    ),
    Fact(
        "dependencies",
        "package.dependencies",
        lambda it: {"package": it.package} if it.of_package.executables else None,
        "package.xml{of_package} names every ROS package that the code uses",
        Words(
            "Write one `<depend>` in package.xml for every ROS package that you import.",
            "Write one `<depend>` in package.xml, and one find_package(...) in CMakeLists.txt, for "
            "every ROS package whose headers you include.",
        ),
        ("builds",),
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
        ("builds",),
        2,
    ),
    Fact(
        "starts",
        "node.starts",
        lambda it: {},
        "{program} starts and creates a node",
        "Run `ros2 run {package} {executable}` yourself and read the last lines that it prints.",
        ("executable",),
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
        ("starts",),
    ),
    Fact(
        "alive",
        "node.alive",
        lambda it: {} if it.program.alive else None,
        "{subject} stays alive",
        Words(
            "rclpy.spin(node) keeps the node running until it is interrupted.",
            "rclcpp::spin(node) keeps the node running until it is interrupted.",
        ),
        ("starts",),
    ),
    Fact(
        "ends",
        "node.ends",
        lambda it: {"within": it.program.ends} if it.program.ends else None,
        "{subject} ends by itself within {ends} of Ctrl+C",
        Words(
            "Ctrl+C ends rclpy.spin() with a KeyboardInterrupt. Do not catch it and go on.",
            "Ctrl+C makes rclcpp::spin() return. Do not start another loop after it, and install "
            "no handler of SIGINT.",
        ),
        ("alive",),
    ),
)

PUBLICATION = (
    Fact(
        "topic",
        "topic.published",
        lambda it: {"topic": it.name, "remap": True},
        "{subject} publishes on {name}",
        _name_hint("publisher"),
        ("starts",),
        2,
    ),
    Fact(
        "type",
        "topic.type",
        lambda it: {"topic": it.name, "type": it.part_as(Connection).type},
        "The topic {name} carries {type}",
        Words(
            "The first argument of create_publisher is the class of the messages.",
            "The type of the messages stands in angle brackets: "
            "create_publisher<package::msg::Type>(...).",
        ),
        ("topic",),
        2,
    ),
    Fact(
        "qos",
        "qos.offered",
        _qos,
        "The publisher{on} is {qos}",
        Words(
            "Give a queue size instead of a QoSProfile. Then you get the default, which is right "
            "here.",
            "Give a queue size instead of an rclcpp::QoS. Then you get the default, which is right "
            "here.",
        ),
        ("topic",),
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
        ("topic",),
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
        ("type",),
        2,
    ),
    Fact(
        "once",
        "messages.count",
        lambda it: (
            {"topic": it.name, "exactly": count}
            if (count := it.part_as(Publication).count)
            else None
        ),
        "Exactly {count} {are} published{on}",
        "Publish neither in a loop nor in a timer that goes on.",
        ("sent",),
        4,
    ),
    Fact(
        "values",
        "messages.equal",
        lambda it: (
            {"topic": it.name, "value": value} if (value := it.part_as(Publication).value) else None
        ),
        "Every message{on} has {value}",
        "Set the fields before you publish; all others keep their default of 0.",
        ("sent",),
        4,
    ),
    Fact(
        "period",
        "timing.period",
        lambda it: (
            {"topic": it.name, **period_of(it.part_as(Publication))}
            if period_of(it.part_as(Publication))
            else None
        ),
        "A message comes every {period}{on}",
        "`ros2 topic hz {name}` shows the rate.",
        ("sent", "alive"),
        8,
    ),
    Fact(
        "rate",
        "timing.rate",
        lambda it: {"topic": it.name, **rate} if (rate := it.part_as(Publication).rate) else None,
        "Messages come with {rate}{on}",
        "`ros2 topic hz {name}` shows the rate.",
        ("sent", "alive"),
        4,
    ),
    Fact(
        "timer",
        "executor.timer",
        lambda it: {"topic": it.name} if it.part_as(Publication).timer else None,
        "A timer calls the callback{on}, not a thread or a loop",
        Words(
            "Create a timer with self.create_timer(period_in_seconds, self.timer_callback), and "
            "publish in its callback.",
            "Create a timer with timer_ = this->create_wall_timer(period, callback), and publish "
            "in its callback.",
        ),
        ("sent", "responsive"),
        4,
    ),
)

SUBSCRIPTION = (
    Fact(
        "subscribes",
        "topic.subscribed",
        lambda it: {"topic": it.name, "remap": True},
        "{subject} subscribes to {name}",
        _name_hint("subscription"),
        ("starts",),
        2,
    ),
    Fact(
        "subscribed_type",
        "topic.type",
        lambda it: {"topic": it.name, "type": it.part_as(Connection).type, "kind": "subscription"},
        "The subscription to {name} is of {type}",
        Words(
            "The first argument of create_subscription is the class of the messages.",
            "The type of the messages stands in angle brackets: "
            "create_subscription<package::msg::Type>(...).",
        ),
        ("subscribes",),
        2,
    ),
    Fact(
        "subscribed_qos",
        "qos.requested",
        _qos,
        "The subscription to {name} is {qos}",
        Words(
            "A queue size or qos_profile_sensor_data is right here.",
            "A queue size or rclcpp::SensorDataQoS() is right here.",
        ),
        ("subscribes",),
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
        ("subscribes",),
    ),
)

AFTERWARDS = (
    Fact(
        "responsive",
        "executor.responsive",
        lambda it: it.program.responsive or None,
        "The callbacks {whose}do not block the executor",
        "Do not loop or sleep in a callback: let it do its work once, and return.",
        ("sent", "alive"),
        4,
    ),
    Fact(
        "untouched",
        "topic.untouched",
        lambda it: (
            None
            if not it.program.leaves_alone
            else {}
            if it.program.leaves_alone == "robot"
            else {"topics": list(it.program.leaves_alone)}
        ),
        "{subject} does not publish on the robot's own topics",
        "Only the robot publishes its sensors. Your node only subscribes to them.",
        ("starts",),
    ),
    Fact(
        "not_subscribed",
        "topic.not_subscribed",
        lambda it: (
            {"topics": list(it.program.does_not_subscribe)}
            if it.program.does_not_subscribe
            else None
        ),
        "{subject} does not subscribe to what is not for it",
        "What it needs comes from another node.",
        ("starts",),
    ),
)
"""Facts of a program that build on those of its topics."""

SERVICE = (
    Fact(
        "service",
        "service.exists",
        lambda it: {"service": it.name, "type": it.part_as(Server).type, "remap": True},
        "{subject} offers the service {name}",
        Words(
            "self.create_service({short}, '{name}', self.callback); `ros2 service list -t` shows "
            "it.",
            'create_service<{cpp_type}>("{name}", callback); `ros2 service list -t` shows it.',
        ),
        ("node",),
        2,
    ),
)

ACTION = (
    Fact(
        "action",
        "action.exists",
        lambda it: {"action": it.name, "type": it.part_as(Server).type, "remap": True},
        "{subject} offers the action {name}",
        Words(
            "ActionServer(self, {short}, '{name}', self.execute); `ros2 action list -t` shows it.",
            'rclcpp_action::create_server<{cpp_type}>(this, "{name}", ...); `ros2 action list '
            "-t` shows it.",
        ),
        ("node",),
        2,
    ),
)


def _asked_of(spot: Spot) -> dict[str, Any]:
    return {"server": spot.name, "more": True}


CALL = (
    Fact(
        "calls",
        "client.asks",
        _asked_of,
        "{subject} calls the service {name}",
        Words(
            "self.create_client({short}, '{name}').call_async(request) sends a request.",
            'create_client<{cpp_type}>("{name}")->async_send_request(request) sends a request.',
        ),
        ("starts",),
        2,
    ),
)

SENT_GOAL = (
    Fact(
        "sends_goals",
        "client.asks",
        _asked_of,
        "{subject} sends a goal to the action {name}",
        Words(
            "ActionClient(self, {short}, '{name}').send_goal_async(goal) sends a goal.",
            'rclcpp_action::create_client<{cpp_type}>(this, "{name}")->async_send_goal(goal) sends '
            "a goal.",
        ),
        ("starts",),
        2,
    ),
)

PARAMETER = (
    Fact(
        "parameter",
        "parameter.declared",
        _declared,
        "The parameter {name} is declared",
        Words(
            "self.declare_parameter('{name}', default) in the constructor.",
            'this->declare_parameter("{name}", default) in the constructor.',
        ),
        ("node",),
        2,
    ),
)

INTERFACE = (
    Fact(
        "definition",
        "interface.found",
        lambda it: {"interface": it.interface, "remap": True},
        "The definition is in {file}",
        "Its folder is beside package.xml, and the file has the name of the interface.",
        ("package",),
    ),
    Fact(
        "fields",
        "interface.fields",
        _definition,
        "{interface} has the fields that are asked for",
        "Two programs can communicate only if they have the same definition.",
        ("definition",),
        4,
    ),
    Fact(
        "constants",
        "interface.constants",
        _constants,
        "{interface} has the constants that are asked for",
        "A constant has a name in upper case and an equals sign.",
        ("definition",),
        4,
    ),
    Fact(
        "generated",
        "interface.generated",
        lambda it: {"interface": it.interface},
        "The build generates {interface}",
        "After `colcon build` and sourcing, `ros2 interface show {interface}` works.",
        ("definition",),
    ),
    Fact(
        "manifest",
        "interface.manifest",
        lambda it: {"interface": it.interface},
        "package.xml{of_package} declares that the package holds interfaces",
        (
            "Your machine has these packages already. Another machine installs only the packages "
            "that package.xml names."
        ),
        ("generated",),
    ),
)


def spots(contract: Contract) -> Iterator[tuple[Spot, Sequence[Fact]]]:
    """The parts of a contract in their order, each with what can be said of it.

    Packages of interfaces come first: the others are built on them.
    """
    named = contract.packages.items()
    for package, one in sorted(named, key=lambda item: not item[1].interfaces):
        place: Place = ("contract", "packages", package)
        here = Spot(contract, place, one, package, package)
        yield here, PACKAGE
        for name, interface in one.interfaces.items():
            inside = (*place, "interfaces", name)
            yield Spot(contract, inside, interface, name, package, around=(here,)), INTERFACE
        for name, program in one.executables.items():
            yield from _of_program(here, name, program)


def _of_program(
    package: Spot, name: str, program: Program
) -> Iterator[tuple[Spot, Sequence[Fact]]]:
    place = (*package.place, "executables", name)
    here = Spot(package.contract, place, program, name, package.package, name, (package,))
    yield here, PROGRAM
    groups: tuple[tuple[str, Mapping[str, Part], Sequence[Fact]], ...] = (
        ("publishes", program.publishes, PUBLICATION),
        ("subscribes", program.subscribes, SUBSCRIPTION),
        ("serves", program.serves, SERVICE),
        ("actions", program.actions, ACTION),
        ("calls", program.calls, CALL),
        ("sends_goals", program.sends_goals, SENT_GOAL),
        ("parameters", program.parameters, PARAMETER),
    )
    around = (here, package)
    for key, parts, facts in groups:
        for inside, part in parts.items():
            spot = Spot(
                package.contract, (*place, key, inside), part, inside, package.package, name, around
            )
            yield spot, facts
    yield here, AFTERWARDS
