"""The models of the stimuli that ask something of a node: calls, parameters, goals."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from grader.spec.name import InterfaceName, QualifiedNodeName, TopicName
from grader.spec.quantity import Duration, DurationOrZero
from grader.spec.source import Model

MOST_CALLS = 1000

_After = Annotated[
    DurationOrZero,
    Field(
        description="Not before so long after the first match, nor before the answers to what is "
        "asked earlier. What has the same `after` is asked in the order of the list; a goal is "
        "answered when it was accepted or rejected.",
        validate_default=False,
    ),
]
_Within = Annotated[
    Duration, Field(description="How long to wait for each answer.", validate_default=False)
]


class ListParameters(Model):
    """Call the parameter service `list_parameters` of every node of the student.

    It answers only while the node's executor spins, and so shows from outside whether a
    callback blocks the executor. A node without parameter services is asked for
    `get_type_description` instead.
    """

    call: Literal["list_parameters"] = Field(description="Always `list_parameters`.")
    every: Duration = Field(description="Time between two calls to one node.")


class CallService(Model):
    """Call a service.

    The first call goes out when the service is there and its node spins. What was asked and
    answered is in the recording's `calls`. Values may use `$name` of `random` and quantities
    such as `30 deg` (in SI units); a field that is left out is zero.
    """

    call: TopicName = Field(description="Fully qualified service name.")
    type: InterfaceName = Field(description="Interface, such as std_srvs/srv/SetBool.")
    request: dict[str, Any] | None = Field(None, description="The fields of the request.")
    requests: tuple[dict[str, Any], ...] = Field(
        (), description="Several requests, one after another, in place of one."
    )
    after: _After = 0.0
    every: Duration | None = Field(
        None,
        description="Time between two calls; by default the next one follows the answer, or "
        "`within`.",
    )
    count: int | None = Field(
        None, ge=1, le=MOST_CALLS, description="How often one `request` is sent."
    )
    at_once: int = Field(
        1, ge=1, le=10, description="Send so many calls at once: the second during the first."
    )
    within: Duration = Field(
        2.0, description="How long to wait for an answer.", validate_default=False
    )

    @model_validator(mode="after")
    def _consistent(self) -> CallService:
        if self.requests and self.request is not None:
            raise ValueError("give either 'request' or 'requests', not both")
        if self.requests and self.count is not None:
            raise ValueError("'count' says how often one 'request' is sent")
        return self

    @property
    def sequence(self) -> tuple[dict[str, Any], ...]:
        """Every request, in order."""
        return self.requests or ((self.request or {},) * (self.count or 1))


class ReadParameters(Model):
    """Read every parameter of a node: its descriptor and its value."""

    read_parameters: QualifiedNodeName = Field(
        description="Name of the node: `bot` is `/bot`; with a namespace `/robot/bot`."
    )
    after: _After = 0.0
    within: _Within = 2.0


class SetParameters(Model):
    """Set parameters of a node, as `ros2 param set` does, and read them before and after.

    The type of a value is that of the YAML: `1` is an integer, `1.0` a double.
    """

    set_parameters: dict[str, Any] = Field(
        min_length=1, description="Name -> value; all are set in one call."
    )
    node: QualifiedNodeName = Field(
        description="Name of the node: `bot` is `/bot`; with a namespace `/robot/bot`."
    )
    after: _After = 0.0
    within: _Within = 2.0


class SendGoal(Model):
    """Send a goal to an action.

    It goes out when the action is there and, unless it is to `preempt`, when the goal before it
    has ended. What became of it is in the recording's `goals`.
    """

    send_goal: TopicName = Field(description="Fully qualified action name.")
    type: InterfaceName = Field(
        description="Interface, such as example_interfaces/action/Fibonacci."
    )
    goal: dict[str, Any] = Field(default_factory=dict, description="The fields of the goal.")
    after: _After = 0.0
    cancel_after: Duration | None = Field(
        None, description="Ask to cancel it so long after it was accepted."
    )
    preempt: bool = Field(False, description="Send it while the goal before it is worked on.")
    within: Duration = Field(
        10.0, description="How long to wait for its result.", validate_default=False
    )


Request = CallService | ReadParameters | SetParameters | SendGoal
