"""The models of ``contract:`` in ``assignment.yaml``.

Names are plain texts here: the packages and checks that are made of them are read as if the author
had written them, and a mistake is told at its line in the contract.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from grader.spec.name import BuildTypes, Durability, Reliability
from grader.spec.source import Model

Ids = str | dict[str, str]
"""A prefix of ids, such as ``publisher``, or ids by their fact."""

_IDS = (
    "Ids of its checks: a prefix, such as `publisher` for `publisher_node`, or a mapping such as "
    "`{type: subscribed_type}`. By default the fact itself; where several have the same fact, "
    "their name comes before it."
)


class Part(Model):
    """Anything in a contract from which checks are made."""

    ids: Ids = Field("", description=_IDS)


class Connection(Part):
    """A publisher or a subscription of a node."""

    type: str = Field(description="Type of its messages, such as geometry_msgs/msg/Twist.")
    reliability: Reliability | None = Field(None, description="By default any.")
    durability: Durability | None = Field(None, description="By default any.")
    depth: int | None = Field(None, ge=1, description="Size of its queue; by default any.")

    @property
    def qos(self) -> dict[str, str]:
        """The reliability and the durability that are asked for."""
        asked = {"reliability": self.reliability, "durability": self.durability}
        return {name: value for name, value in asked.items() if value is not None}


class Publication(Connection):
    """A topic on which a node publishes."""

    count: int | None = Field(None, ge=1, description="How many messages it publishes in a run.")
    value: dict[str, Any] = Field(
        default_factory=dict,
        description="Value of every message, as in `messages.equal`; other fields are 0.",
    )
    period: str | dict[str, Any] | None = Field(
        None,
        description="Period of its messages, such as `300 ms`, or the parameters of "
        "`timing.period`, such as `{period: 300 ms, spread: 20 %}`.",
    )
    rate: dict[str, Any] = Field(
        default_factory=dict,
        description="How often they come, roughly: the parameters of `timing.rate`, such as "
        "`{at_least: 9 Hz, at_most: 11 Hz}`.",
    )
    timer: bool = Field(False, description="Whether the callback of a timer must publish them.")

    @model_validator(mode="after")
    def _has_period(self) -> Publication:
        if isinstance(self.period, dict) and "period" not in self.period:
            raise ValueError("a period with other parameters is {period: 300 ms, spread: 20 %}")
        return self


class Subscription(Connection):
    """A topic to which a node subscribes."""


class Server(Part):
    """A service or an action that a node offers or uses."""

    type: str = Field(description="Its interface, such as std_srvs/srv/SetBool.")


class Declared(Part):
    """A parameter that a node declares."""

    type: str | None = Field(None, description="Such as `double`; by default any.")
    default: Any = Field(None, description="Its value before it is set; by default any.")
    range: tuple[Any, Any] | None = Field(None, description="Lowest and highest value.")
    read_only: bool | None = Field(None, description="Whether it is read-only.")
    described: bool = Field(False, description="Whether its descriptor has a description.")


class Program(Part):
    """An executable, and the node that it runs."""

    node: str = Field(
        "any", description="Name of its node, with its namespace if it has one; or `any`."
    )
    scenarios: tuple[str, ...] = Field(
        (), description="Scenarios in which it is judged; by default all."
    )
    alive: bool = Field(True, description="Whether it runs until it is interrupted.")
    ends: str | None = Field(None, description="Time in which it ends after Ctrl+C, such as `2 s`.")
    responsive: dict[str, Any] = Field(
        default_factory=dict,
        description="How soon it answers while its callbacks run: the parameters of "
        "`executor.responsive`, such as `{within: 1 s}`.",
    )
    publishes: dict[str, Publication] = Field(default_factory=dict, description="By topic.")
    subscribes: dict[str, Subscription] = Field(default_factory=dict, description="By topic.")
    serves: dict[str, Server] = Field(default_factory=dict, description="Services, by name.")
    actions: dict[str, Server] = Field(default_factory=dict, description="Actions, by name.")
    calls: dict[str, Server] = Field(
        default_factory=dict,
        description="Services that it calls, by name; judged where the scenario has a `serve`.",
    )
    sends_goals: dict[str, Server] = Field(
        default_factory=dict,
        description="Actions that it sends goals to, by name; judged as `calls` are.",
    )
    parameters: dict[str, Declared] = Field(default_factory=dict, description="By name.")
    leaves_alone: Literal["robot"] | tuple[str, ...] = Field(
        (),
        description="Topics on which it must not publish; `robot`: those of the simulated robot.",
    )
    does_not_subscribe: tuple[str, ...] = Field(
        (), description="Topics to which it must not subscribe."
    )


class Interface(Part):
    """An interface that students define."""

    definition: str = Field(description="Its definition, as in its file.")


class ContractPackage(Part):
    """A package that students hand in."""

    build_type: BuildTypes = Field(
        ("ament_python",),
        description="With `[ament_python, ament_cmake]` students choose between Python and C++.",
    )
    depends: tuple[str, ...] = Field((), description="ROS packages that the solution needs.")
    executables: dict[str, Program] = Field(
        default_factory=dict, description="Its programs, by the name of the executable."
    )
    interfaces: dict[str, Interface] = Field(
        default_factory=dict,
        description="Interfaces that it defines, by kind and name, such as `msg/BotStatus`.",
    )

    @model_validator(mode="after")
    def _generates(self) -> ContractPackage:
        if self.interfaces and self.build_type != ("ament_cmake",):
            raise ValueError("CMake generates interfaces: write 'build_type: ament_cmake'")
        return self


class Contract(Model):
    """What the ROS graph of a right submission looks like.

    From it come `packages`, the standard checks with their hints, the table of the handout at the
    line `<!-- contract -->`, the starter package and the standard mutants. What follows in
    `checks` is what the lesson adds. `rosgrade validate --expanded` prints all that is made of it.
    """

    packages: dict[str, ContractPackage] = Field(
        min_length=1, description="Packages that students hand in, by name."
    )
    points: float | dict[str, Annotated[float, Field(ge=0)]] = Field(
        description="Points by the id of the check; what is not named is not judged. Or one "
        "number for all of them, which is shared out by their weight."
    )
    checks: dict[str, dict[str, Any]] = Field(
        default_factory=dict,
        description="What differs from the standard check, by its id: any key of an entry of "
        "`checks`, such as `{period: {requires: [moves], hint: ...}}`.",
    )

    @model_validator(mode="after")
    def _positive(self) -> Contract:
        if isinstance(self.points, float) and self.points <= 0.0:
            raise ValueError("the points are above 0")
        return self

    @property
    def programs(self) -> dict[tuple[str, str], Program]:
        """Its programs, by package and executable."""
        return {
            (package, name): program
            for package, one in self.packages.items()
            for name, program in one.executables.items()
        }
