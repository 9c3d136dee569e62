"""The models of ``stimuli``: what the probe does in a scenario besides observing.

A stimulus is told by its first key: ``publish``, ``join``, ``kill``, ``restart``, ``call``,
``read_parameters``, ``set_parameters`` or ``send_goal``.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from grader.assignment.stimuli.request import (
    CallService,
    ListParameters,
    ReadParameters,
    SendGoal,
    SetParameters,
)
from grader.spec.name import (
    Durability,
    Id,
    InterfaceName,
    PackageName,
    Reliability,
    TopicName,
)
from grader.spec.nearest_name import nearest
from grader.spec.quantity import Duration, DurationOrZero
from grader.spec.source import Model

MCAP_SUFFIX = ".mcap"
MOST_MESSAGES = 10_000


class Publish(Model):
    """Publish messages.

    The first one goes out when a subscription of the student has matched, and never before.
    What was published is in the recording's `sent`. The values may use `$name` of `random`, and
    quantities such as `30 deg` (in SI units); a field that is left out is zero. A time may be
    `now`. Give the messages in one way: `message`, `messages`, `from` or `python`.
    """

    publish: TopicName = Field(description="Topic to publish on; it is not in `record`.")
    type: InterfaceName = Field(description="Interface, such as std_msgs/msg/String.")
    message: dict[str, Any] | None = Field(None, description="One message: its fields.")
    messages: tuple[dict[str, Any], ...] = Field((), description="Several, one after another.")
    from_: str | None = Field(
        None,
        alias="from",
        description="A CSV file beside assignment.yaml with a message in each row (its first row "
        "names the fields: `linear.x`, `data[0]`), or an MCAP file with messages on this topic.",
    )
    python: str | None = Field(
        None,
        description="An own function, `file.py:function`, beside assignment.yaml: it takes the "
        "scenario's seed and returns a list of messages, each a dict of its fields.",
    )
    after: DurationOrZero = Field(
        0.0, description="Not before so long after the first match.", validate_default=False
    )
    every: Duration | None = Field(
        None,
        description="Time between two messages. One `message` is repeated with it, `count` times "
        "or until the end. Messages of an MCAP file have the times of the file by default.",
    )
    count: int | None = Field(
        None, ge=1, le=MOST_MESSAGES, description="How often one `message` is published."
    )
    answer: TopicName | None = Field(
        None,
        description="Send the next message only when one was received on this recorded topic, or "
        "when `within` has passed. One that is the same as before may be a copy, and counts a "
        "moment later.",
    )
    within: Duration = Field(
        1.0, description="How long to wait for an `answer`.", validate_default=False
    )
    before_launch: int = Field(
        0,
        ge=0,
        le=MOST_MESSAGES,
        description="So many of the messages are published at once, before anything of the "
        "student's is launched; the others follow when a subscription has matched.",
    )
    reliability: Reliability = Field("reliable", description="Offered reliability.")
    durability: Durability = Field("volatile", description="Offered durability.")
    depth: int = Field(100, ge=1, le=10_000, description="Queue depth of the publisher.")

    @model_validator(mode="after")
    def _consistent(self) -> Publish:
        given = {
            "message": self.message is not None,
            "messages": bool(self.messages),
            "from": self.from_ is not None,
            "python": self.python is not None,
        }
        names = [name for name, there in given.items() if there]
        if len(names) != 1:
            told = f"not {' and '.join(names)}" if names else "but none of them is there"
            raise ValueError(f"give the messages in one way of {', '.join(given)}, {told}")
        if self.count is not None:
            if self.message is None:
                raise ValueError("'count' says how often one 'message' is published")
            if self.count > max(1, self.before_launch) and not self.paced:
                raise ValueError("'count' needs a pace: give 'every' or 'answer'")
        if self.before_launch and self.durability == "volatile":
            raise ValueError(
                "what is published 'before_launch' is lost for later subscriptions unless the "
                "durability is transient_local"
            )
        if self._is_several and not self.paced:
            raise ValueError("several messages need a pace: give 'every' or 'answer'")
        return self

    @property
    def _is_several(self) -> bool:
        """Whether more than one message may follow the launch, without times of their own."""
        read = self.from_ is not None and not self.from_.endswith(MCAP_SUFFIX)
        if read or self.python is not None:
            return not self.before_launch
        return len(self.messages) > self.before_launch + 1

    @property
    def paced(self) -> bool:
        """Whether it is said when the next message follows."""
        return self.every is not None or self.answer is not None


class Join(Model):
    """Join late: a further subscription of the probe, created in the middle of the run.

    Its messages are recorded under its own name, apart from those of `record`. Where `record`
    leaves the topic out, it is the first subscription to it.
    """

    join: TopicName = Field(description="Topic to subscribe to.")
    type: InterfaceName = Field(description="Interface, such as std_msgs/msg/Int64.")
    name: Id = Field(description="Name of what it records, for the checks.")
    after: DurationOrZero = Field(description="When: so long after the first match.")
    reliability: Reliability = Field("reliable", description="Requested reliability.")
    durability: Durability = Field("volatile", description="Requested durability.")
    depth: int = Field(100, ge=1, le=10_000, description="Queue depth of the subscription.")


Signal = Literal["SIGINT", "SIGTERM", "SIGKILL"]


class Kill(Model):
    """Send a signal to a process of the student."""

    kill: str = Field(description="Name of the executable.")
    package: PackageName | None = Field(None, description="Its package, where several have it.")
    after: DurationOrZero = Field(description="When: so long after the first match.")
    signal: Signal = Field("SIGINT", description="The signal: SIGINT is Ctrl-C.")


class Restart(Model):
    """Start a process of the student again, as it was launched; one that still runs is ended."""

    restart: str = Field(description="Name of the executable.")
    package: PackageName | None = Field(None, description="Its package, where several have it.")
    after: DurationOrZero = Field(description="When: so long after the first match.")


# The first key of an entry -> its model. Tags are the models' own names, as errors know them.
_KINDS: dict[str, type[Model]] = {
    "publish": Publish,
    "join": Join,
    "kill": Kill,
    "restart": Restart,
    "call": CallService,
    "read_parameters": ReadParameters,
    "set_parameters": SetParameters,
    "send_goal": SendGoal,
}


def _kind(value: Any) -> str | None:
    """The tag of an entry: by the key that tells it, else by one that nearly does."""
    if isinstance(value, Model):
        return type(value).__name__
    keys = [str(key) for key in value] if isinstance(value, dict) else []
    found = next((key for key in keys if key in _KINDS), None)
    found = found or next((near for key in keys[:1] if (near := nearest(key, _KINDS))), None)
    # `call` also stands for the one service that every node has.
    if found == "call" and not str(value.get("call", "")).startswith("/"):
        return ListParameters.__name__
    return _KINDS[found].__name__ if found else None


Stimulus = Annotated[
    Annotated[Publish, Tag("Publish")]
    | Annotated[Join, Tag("Join")]
    | Annotated[Kill, Tag("Kill")]
    | Annotated[Restart, Tag("Restart")]
    | Annotated[ListParameters, Tag("ListParameters")]
    | Annotated[CallService, Tag("CallService")]
    | Annotated[ReadParameters, Tag("ReadParameters")]
    | Annotated[SetParameters, Tag("SetParameters")]
    | Annotated[SendGoal, Tag("SendGoal")],
    Discriminator(
        _kind,
        custom_error_type="stimulus",
        custom_error_message=f"its first key tells what it does: {', '.join(_KINDS)}",
    ),
]
