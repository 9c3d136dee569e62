"""The models of the stimuli that ask something of a node: calls, parameters, goals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator

from grader.assignment.random_values import fill_in
from grader.assignment.stimuli.message import StimulusError, part_of, read_message
from grader.assignment.stimuli.stimulus_model import Preparation, StimulusModel, kind
from grader.checks.need import Act
from grader.errors import UsageError
from grader.spec.document import Place
from grader.spec.name import InterfaceName, QualifiedNodeName, TopicName
from grader.spec.quantity import Duration, DurationOrZero

MOST_CALLS = 1000

_After = Annotated[
    DurationOrZero,
    Field(
        description="Earliest time, counted from the first match. The probe also waits for the "
        "answers to earlier requests. Requests with the same `after` are sent in the "
        "order of the list. The answer to a goal is its acceptance or rejection."
    ),
]
_Within = Annotated[Duration, Field(description="How long to wait for each answer.")]


@kind
class ListParameters(StimulusModel):
    """Call the parameter service `list_parameters` of every node of the student.

    The service answers only while the node's executor spins. So it shows whether a callback blocks
    the executor. For a node without parameter services, the probe calls `get_type_description`
    instead.
    """

    key = "call"
    heading = "call list_parameters"

    call: Literal["list_parameters"] = Field(description="Always `list_parameters`.")
    every: Duration = Field(description="Time between two calls to one node.")

    @classmethod
    def accepts(cls, value: Mapping[str, Any]) -> bool:
        """Whether it names the one service that every node has."""
        return not str(value.get("call", "")).startswith("/")

    @property
    def has_end(self) -> bool:
        """It is called until the run ends."""
        return False


@dataclass(frozen=True)
class Request:
    """One request to a service.

    Attributes:
        pause_s: Time after the request before it; None to wait for the answer to that one.
    """

    service: str
    type: str
    fields: Mapping[str, Any]
    pause_s: float | None = None


@kind
class CallService(StimulusModel):
    """Call a service.

    The probe sends the first call when the service is there and its node spins. Requests and
    responses are in the recording's `calls`. Values may use `$name` of `random` and quantities such
    as `30 deg` (in SI units). An omitted field is zero.
    """

    key = "call"
    provides = (Act.CALL,)

    call: TopicName = Field(description="Fully qualified service name.")
    type: InterfaceName = Field(description="Interface, such as std_srvs/srv/SetBool.")
    request: dict[str, Any] | None = Field(None, description="The fields of the request.")
    requests: tuple[dict[str, Any], ...] = Field(
        (), description="Several requests, one after another, instead of `request`."
    )
    after: _After = 0.0
    every: Duration | None = Field(
        None,
        description="Time between two calls; by default the next call follows after the answer or "
        "after `within`.",
    )
    count: int | None = Field(
        None, ge=1, le=MOST_CALLS, description="How often one `request` is sent."
    )
    at_once: int = Field(
        1,
        ge=1,
        le=10,
        description="Number of calls to send at once: the second call comes during the first.",
    )
    within: Duration = Field(2.0, description="How long to wait for an answer.")

    @model_validator(mode="after")
    def _consistent(self) -> CallService:
        if self.requests and self.request is not None:
            raise ValueError("give either 'request' or 'requests', not both")
        if self.requests and self.count is not None:
            raise ValueError("'count' says how often one 'request' is sent")
        return self

    @property
    def sent_fields(self) -> tuple[dict[str, Any], ...]:
        """The fields of every request, in order."""
        return self.requests or ((self.request or {},) * (self.count or 1))

    @property
    def asked(self) -> tuple[Request, ...]:
        """Every request, in order."""
        return tuple(Request(self.call, self.type, one, self.every) for one in self.sent_fields)

    @property
    def in_turn(self) -> bool:
        """Whether later requests wait for all of its answers; one at its own pace runs beside."""
        return self.every is None

    def prepared(self, preparation: Preparation) -> CallService:
        """The same with its requests read."""
        requests = tuple(
            _fields(
                value, self, preparation, ("requests", index) if self.requests else ("request",)
            )
            for index, value in enumerate(self.sent_fields)
        )
        return self.model_copy(update={"requests": requests})


@kind
class Lifecycle(StimulusModel):
    """Lead a lifecycle node through transitions, as `ros2 lifecycle set` does.

    The probe calls `get_state` first and again after each transition (`change_state`).
    """

    key = "lifecycle"
    provides = (Act.CALL,)

    lifecycle: QualifiedNodeName = Field(
        description="Name of the node: `bot` is `/bot`; with a namespace `/robot/bot`."
    )
    do: tuple[Literal["configure", "activate", "deactivate", "cleanup", "shutdown"], ...] = Field(
        min_length=1, description="The transitions, one after another."
    )
    after: _After = 0.0
    every: Duration | None = Field(
        None,
        description="How long the node stays in each state; by default the next transition "
        "follows after the answer.",
    )
    within: _Within = 4.0

    at_once: ClassVar[int] = 1
    in_turn: ClassVar[bool] = True

    @property
    def subject(self) -> str:
        """The service that it calls for the state."""
        return f"{self.lifecycle}/get_state"

    @property
    def exchanged(self) -> tuple[str, str]:
        """That service, and its type."""
        return self.subject, "lifecycle_msgs/srv/GetState"

    @property
    def asked(self) -> tuple[Request, ...]:
        """Every request, in order."""
        change = f"{self.lifecycle}/change_state", "lifecycle_msgs/srv/ChangeState"
        state = Request(*self.exchanged, {})
        steps = (Request(*change, {"transition": {"label": one}}, self.every) for one in self.do)
        return (state, *(request for step in steps for request in (step, state)))


@kind
class ReadParameters(StimulusModel):
    """Read every parameter of a node: its descriptor and its value."""

    key = "read_parameters"
    provides = (Act.READ_PARAMETERS,)

    read_parameters: QualifiedNodeName = Field(
        description="Name of the node: `bot` is `/bot`; with a namespace `/robot/bot`."
    )
    after: _After = 0.0
    within: _Within = 2.0

    @property
    def node(self) -> str:
        """The node."""
        return self.read_parameters


@kind
class SetParameters(StimulusModel):
    """Set parameters of a node, as `ros2 param set` does, and read them before and after.

    A value has the type that it has in the YAML: `1` is an integer, `1.0` a double.
    """

    key = "set_parameters"
    provides = (Act.READ_PARAMETERS, Act.SET_PARAMETERS)

    set_parameters: dict[str, Any] = Field(
        min_length=1, description="Name -> value; all are set in one call."
    )
    node: QualifiedNodeName = Field(
        description="Name of the node: `bot` is `/bot`; with a namespace `/robot/bot`."
    )
    after: _After = 0.0
    within: _Within = 2.0

    @property
    def subject(self) -> str:
        """The node."""
        return self.node

    @property
    def sent_fields(self) -> Sequence[Mapping[str, Any]]:
        """The values by name."""
        return (self.set_parameters,)

    def prepared(self, preparation: Preparation) -> SetParameters:
        """The same with its values read."""
        drawn = dict(preparation.drawn)
        values = {name: _value(name, item, drawn) for name, item in self.set_parameters.items()}
        return self.model_copy(update={"set_parameters": values})


class AskDeclared(StimulusModel):
    """Ask every node which parameters it declares: part of a run that is given parameters."""

    names: tuple[str, ...]


def _value(name: str, value: Any, drawn: dict[str, float]) -> Any:
    """The value that a parameter is set to, of a type that parameters have."""
    place: Place = ("set_parameters", name)
    try:
        filled = fill_in(value, drawn)
    except UsageError as error:
        raise StimulusError(str(error), place) from None
    types = {type(item) for item in (filled if isinstance(filled, list) else [filled])}
    is_of_one_type = len(types) == 1 or types == {int, float}
    if not types <= {bool, int, float, str} or not is_of_one_type:
        text = f"{name}: expected true or false, a number, a text, or a list of one of these"
        raise StimulusError(text, place)
    return filled


@kind
class SendGoal(StimulusModel):
    """Send a goal to an action.

    The probe sends the goal when the action is there and the previous goal has ended (with
    `preempt`, while it is executed). The outcome is in the recording's `goals`.
    """

    key = "send_goal"
    provides = (Act.SEND_GOAL,)

    send_goal: TopicName = Field(description="Fully qualified action name.")
    type: InterfaceName = Field(
        description="Interface, such as example_interfaces/action/Fibonacci."
    )
    goal: dict[str, Any] = Field(default_factory=dict, description="The fields of the goal.")
    after: _After = 0.0
    cancel_after: Duration | None = Field(
        None, description="Time from acceptance of the goal to the cancel request."
    )
    preempt: bool = Field(False, description="Send the goal while the previous goal is executed.")
    within: Duration = Field(10.0, description="How long to wait for its result.")

    @property
    def sent_fields(self) -> Sequence[Mapping[str, Any]]:
        """The goal."""
        return (self.goal,)

    def prepared(self, preparation: Preparation) -> SendGoal:
        """The same with its goal read."""
        return self.model_copy(update={"goal": _fields(self.goal, self, preparation, ("goal",))})


def _fields(
    value: Mapping[str, Any], item: CallService | SendGoal, preparation: Preparation, place: Place
) -> dict[str, Any]:
    folder = "srv" if isinstance(item, CallService) else "action"
    if f"/{folder}/" not in item.type:
        text = f"expected an interface in {folder}, such as package/{folder}/Name"
        raise StimulusError(text, ("type",))
    find = part_of(preparation.find, item.type, 0)
    return read_message(value, item.type, find, preparation.drawn, place)
