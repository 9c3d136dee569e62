"""The stimulus that publishes messages."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from pydantic import Field, model_validator

from grader.assignment.stimuli.message import StimulusError, read_message
from grader.assignment.stimuli.stimulus_messages import (
    MCAP_SUFFIX,
    UnreadMessage,
    from_file,
    from_function,
)
from grader.assignment.stimuli.stimulus_model import (
    Preparation,
    ScenarioOfStimuli,
    StimulusModel,
    kind,
)
from grader.checks.need import Act
from grader.findings.fields import each_field
from grader.spec.document import Place
from grader.spec.name import Durability, InterfaceName, Reliability, TopicName
from grader.spec.nearest_name import did_you_mean
from grader.spec.quantity import Duration, DurationOrZero

MOST_MESSAGES = 10_000
Due = tuple[dict[str, Any] | bytes, float]
"""A message, as fields or serialized, and its time in seconds."""


@kind
class Publish(StimulusModel):
    """Publish messages.

    The probe publishes the first message when a subscription of the student has matched. Published
    messages are in the recording's `sent`. Values may use `$name` of `random` and quantities such
    as `30 deg` (in SI units). An omitted field is zero. A time may be `now`. Give the messages with
    exactly one of `message`, `messages`, `from` and `python`.
    """

    key = "publish"
    provides = (Act.PUBLISH,)

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
    after: DurationOrZero = Field(0.0, description="Earliest time, counted from the first match.")
    every: Duration | None = Field(
        None,
        description="Time between two messages. One `message` is repeated with it, `count` times "
        "or until the end. Messages of an MCAP file have the times of the file by default.",
    )
    count: int | None = Field(
        None,
        ge=1,
        le=MOST_MESSAGES,
        description="How often the message is published, or all of them, one round after another.",
    )
    answer: TopicName | None = Field(
        None,
        description="Send the next message only after a message on this recorded topic, or after "
        "`within`. A message that is equal to the previous one may be a copy, and "
        "counts slightly later.",
    )
    within: Duration = Field(1.0, description="How long to wait for an `answer`.")
    before_launch: int = Field(
        0,
        ge=0,
        le=MOST_MESSAGES,
        description="Number of messages to publish before the launch of the student's processes. "
        "The others follow after the first subscription has matched.",
    )
    reliability: Reliability = Field("reliable", description="Offered reliability.")
    durability: Durability = Field("volatile", description="Offered durability.")
    depth: int = Field(100, ge=1, le=10_000, description="Queue depth of the publisher.")
    _due: tuple[Due, ...] = ()

    @model_validator(mode="after")
    def _consistent(self) -> Publish:
        is_given = {
            "message": self.message is not None,
            "messages": bool(self.messages),
            "from": self.from_ is not None,
            "python": self.python is not None,
        }
        given_keys = [key for key, given in is_given.items() if given]
        if len(given_keys) != 1:
            lack = f"not {' and '.join(given_keys)}" if given_keys else "but none is given"
            raise ValueError(f"give the messages by one of {', '.join(is_given)}, {lack}")
        if self.count is not None and self._is_of_a_bag and self.every is None:
            raise ValueError(
                "messages with times of their own are published once: leave out 'count'"
            )
        if self._is_several and not self._is_paced:
            raise ValueError("several messages need a pace: give 'every' or 'answer'")
        return self

    @property
    def _is_several(self) -> bool:
        """Whether more than one message may follow the launch, without times of their own."""
        if self._is_of_a_bag:
            return False
        if self.from_ is not None or self.python is not None:
            return not self.before_launch
        number = (self.count or 1) * max(len(self.messages), 1)
        return number > max(1, self.before_launch + (1 if self.messages else 0))

    @property
    def _is_of_a_bag(self) -> bool:
        """Whether the messages come with times of their own."""
        return self.from_ is not None and self.from_.endswith(MCAP_SUFFIX)

    @property
    def _is_paced(self) -> bool:
        """Whether the YAML says when the next message follows."""
        return self.every is not None or self.answer is not None

    @property
    def has_end(self) -> bool:
        """Whether it publishes a last message."""
        return self.message is None or self.every is None or self.count is not None

    @property
    def frames(self) -> frozenset[tuple[str, str]]:
        """Parent and child of each transform in the messages that stand in the YAML."""
        messages = list(self.messages)
        if self.message is not None:
            messages.append(self.message)
        frames = set()
        for message in messages:
            transforms = message.get("transforms")
            if not isinstance(transforms, list):
                continue
            for transform in transforms:
                fields = dict(each_field(transform)) if isinstance(transform, dict) else {}
                parent, child = fields.get("header.frame_id"), fields.get("child_frame_id")
                if parent and child:
                    frames.add((str(parent), str(child)))
        return frozenset(frames)

    @property
    def due(self) -> tuple[Due, ...]:
        """What a cell publishes; a message that is repeated without end is there once."""
        return self._due

    def prepared(self, preparation: Preparation) -> Publish:
        """The same with its messages read."""
        return self if self._due else self.sending(self._read(preparation))

    def sending(self, due: Iterable[Due]) -> Publish:
        """The same with these messages."""
        copy = self.model_copy()
        copy._due = tuple(due)
        return copy

    def _read(self, preparation: Preparation) -> Iterator[Due]:
        one_round, rounds = list(self._unread(preparation)), self.count or 1
        key = "from" if self.from_ is not None else "python"
        if not one_round:
            raise StimulusError(f"{self.from_ or self.python} has no message", (key,))
        if len(one_round) * rounds > MOST_MESSAGES:
            text = f"{len(one_round) * rounds} messages: at most {MOST_MESSAGES} are published"
            raise StimulusError(text, (key,))
        messages = one_round * rounds
        if self.before_launch > len(messages):
            raise StimulusError(f"there are only {len(messages)} messages", ("before_launch",))
        for number, unread in enumerate(messages):
            yield self._value(unread, preparation), self._time_s(number, unread)

    def _value(self, unread: UnreadMessage, preparation: Preparation) -> dict[str, Any]:
        try:
            find, drawn = preparation.find, preparation.drawn
            return read_message(unread.value, self.type, find, drawn, unread.place)
        except StimulusError as error:
            if unread.label:
                raise StimulusError(f"{unread.label}: {error}", unread.place) from None
            raise

    def _time_s(self, number: int, unread: UnreadMessage) -> float:
        """When a message is due; ``every`` replaces the times of a file."""
        if self.every is not None:
            return number * self.every
        return 0.0 if unread.time_s is None else unread.time_s

    def _unread(self, preparation: Preparation) -> Iterable[UnreadMessage]:
        if self.message is not None:
            return [UnreadMessage(self.message, ("message",))]
        if self.from_ is not None:
            return from_file(self.from_, preparation.folder, self.publish, self.type)
        if self.python is not None:
            return from_function(self.python, preparation.folder, preparation.seed)
        return [
            UnreadMessage(value, ("messages", index)) for index, value in enumerate(self.messages)
        ]

    def mistakes(
        self, preparation: Preparation, scenario: ScenarioOfStimuli
    ) -> Iterator[tuple[Place, str]]:
        """Its topic or its messages do not fit."""
        recorded = scenario.recorded_types
        # Transforms of the author's and of the student's are told apart by their frames.
        if self.publish in recorded and not self.frames:
            text = f"{self.publish!r} is recorded: only the student may publish there"
            yield ("publish",), text
        if self.answer is not None and self.answer not in recorded:
            listed = f" It records: {', '.join(recorded) or 'nothing'}."
            advice = did_you_mean(self.answer, recorded) or listed
            yield ("answer",), f"the scenario does not record {self.answer!r}.{advice}"
        yield from super().mistakes(preparation, scenario)
