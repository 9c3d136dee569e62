"""Values that follow one another: counting, or a list."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

from pydantic import Field, model_validator

from grader.checks.check import NamedFields, Parameters, Subject, check
from grader.checks.field import FieldPath, value_at
from grader.checks.finding import Evidence, Finding, Moment, Table
from grader.checks.need import Recorded
from grader.checks.value import NoSuchField, same
from grader.checks.wording import code, counted, value_text
from grader.diagnosis.few_messages import why_few
from grader.diagnosis.no_messages import why_silent
from grader.recording.model import Message, Recording
from grader.spec.name import TopicName

_SEQUENCE_LIMIT = 2**62
_SHOWN = 12


class Series(Parameters):
    """Parameters of messages.sequence."""

    needs = (Recorded(),)

    topic: TopicName = Field(description="Fully qualified topic name.")
    field: FieldPath = Field(description="The field that changes, such as `data`.")
    values: tuple[float | str | bool, ...] = Field(
        (), description="The values of the first messages, in order."
    )
    step: float | None = Field(
        None, description="Instead of `values`: how much larger it is in each message."
    )
    start: float | None = Field(
        None, description="With `step`: the value in the very first message; by default any."
    )
    tolerance: float = Field(
        1e-9, ge=0, allow_inf_nan=False, description="Largest difference of two numbers."
    )
    at_least: int = Field(
        3, ge=1, description="With `step`: how many messages must have come to judge."
    )

    @model_validator(mode="after")
    def _one_way(self) -> Series:
        if bool(self.values) == (self.step is not None):
            raise ValueError("give either 'values' or 'step'")
        if self.start is not None and self.step is None:
            raise ValueError("'start' goes with 'step'")
        return self

    def named_fields(self) -> Iterator[NamedFields]:
        """The field, with each of its values."""
        yield NamedFields(("field",), self.topic, self.field)
        for number, value in enumerate(self.values):
            yield NamedFields(
                ("values", number), self.topic, {self.field: value}, tolerance=self.tolerance
            )

    @property
    def needed(self) -> int:
        """Messages without which nothing can be judged."""
        return len(self.values) or self.at_least

    @property
    def words(self) -> str:
        """What is expected, in words."""
        who = f"{code(self.field)} of the messages on {code(self.topic)}"
        if self.values:
            listed = ", ".join(value_text(_plain(item)) for item in self.values[:_SHOWN])
            more = ", ..." if len(self.values) > _SHOWN else ""
            return f"{who}: {listed}{more}, in this order"
        begins = "" if self.start is None else f" from {value_text(_plain(self.start))} on"
        verb = "counts" if self.step == 1 else f"grows by {value_text(_plain(self.step))}"
        return f"{who} {verb}{begins}, message by message"


@check("messages.sequence", Subject.RECORDING, Series)
def sequence(recording: Recording, parameters: Series) -> Finding:
    """The values come in the right order.

    Compares one field of each message with the value that it should have at its place: counting
    by a `step`, or a list of `values`. A message that the writer numbered but that was lost on
    its way leaves its place out.
    """
    expected = parameters.words
    messages = recording.on(parameters.topic)
    if not messages:
        return why_silent(recording, parameters.topic).finding(expected)
    try:
        found = [value_at(message.value, parameters.field) for message in messages]
    except NoSuchField as error:
        return Finding.error(
            expected, f"the assignment expects what {messages[0].type} cannot be: {error}"
        )
    places = _places(messages)
    wanted = _wanted(parameters, found, places)
    wrong = [
        index
        for index, value in enumerate(wanted)
        if value is not None and not _same(value, found[index], parameters.tolerance)
    ]
    if wrong:
        return _failed(recording, parameters, found, wanted, wrong[0])
    if len(messages) < parameters.needed:
        return why_few(recording, parameters.topic, parameters.needed).finding(expected)
    if parameters.values and not any(place == len(parameters.values) - 1 for place in places):
        return Finding.to_repeat(
            expected, "the last of these messages was lost on its way to the probe"
        )
    return Finding.passed(
        expected,
        f"{value_text(found[0])} to {value_text(found[-1])} in {counted(len(found), 'message')}",
    )


def _places(messages: Sequence[Message]) -> list[int]:
    """Place of each message in all that its writer wrote, from 0; by arrival if unnumbered."""
    numbers = [message.sequence for message in messages]
    growing = all(a < b for a, b in pairwise(numbers))
    if growing and numbers[0] > 0 and numbers[-1] < _SEQUENCE_LIMIT:
        return [number - 1 for number in numbers]
    return list(range(len(messages)))


def _wanted(parameters: Series, found: Sequence[Any], places: Sequence[int]) -> list[Any]:
    """The value that each message should have; None where any will do."""
    if parameters.values:
        values = parameters.values
        return [values[place] if place < len(values) else None for place in places]
    assert parameters.step is not None
    if parameters.start is not None:
        return [parameters.start + parameters.step * place for place in places]
    base = found[0]
    if isinstance(base, str) or not isinstance(base, int | float):
        return [parameters.step] * len(found)
    return [base + parameters.step * (place - places[0]) for place in places]


def _same(wanted: Any, found: Any, tolerance: float) -> bool:
    if isinstance(wanted, str) or isinstance(found, str):
        return bool(wanted == found)
    return same(wanted, found, tolerance)


def _failed(
    recording: Recording,
    parameters: Series,
    found: Sequence[Any],
    wanted: Sequence[Any],
    first: int,
) -> Finding:
    message = recording.on(parameters.topic)[first]
    words, hint = _explanation(parameters, found, wanted)
    rows = tuple(
        (str(index + 1), value_text(_plain(want)) if want is not None else "any", value_text(have))
        for index, (want, have) in enumerate(zip(wanted, found, strict=True))
    )
    return Finding.failed(
        parameters.words,
        f"{code(parameters.field)} is {value_text(found[first])} instead of "
        f"{value_text(_plain(wanted[first]))} in message {first + 1} of {len(found)}{words}",
        hint,
        Evidence(
            moments=(
                Moment(f"message {first + 1} is wrong", recording.since_launch_s(message.stamp_ns)),
            ),
            tables=(
                Table(
                    f"{parameters.field} of {parameters.topic}",
                    ("message", "expected", "observed"),
                    rows[:50],
                ),
            ),
        ),
    )


def _explanation(
    parameters: Series, found: Sequence[Any], wanted: Sequence[Any]
) -> tuple[str, str]:
    if not all(isinstance(item, int | float) for item in found):
        return _listed(found, wanted)
    steps = [b - a for a, b in pairwise(found)]
    if steps and not any(steps):
        return (
            ": the value never changes",
            "Keep the value in an attribute of the node, such as self.count, and change it in the "
            "timer's callback.",
        )
    if parameters.step is None:
        return _listed(found, wanted)
    step = parameters.step
    regular = bool(steps) and all(same(steps[0], item, parameters.tolerance) for item in steps)
    if regular and same(step, steps[0], parameters.tolerance):
        return (
            f": it begins with {value_text(found[0])}",
            "Set the first value in the node's constructor, and change it after publish(msg), not "
            "before.",
        )
    if regular:
        return (
            f": it grows by {value_text(steps[0])} from message to message, not by "
            f"{value_text(_plain(step))}",
            "Change the value once for every message, by what is asked for.",
        )
    # Where a value only stands twice, what comes next is not begun anew.
    once = [found[0], *(item for item, grown in zip(found[1:], steps, strict=True) if grown)]
    if len(once) < len(found) and all(
        same(b - a, step, parameters.tolerance) for a, b in pairwise(once)
    ):
        return (
            f": message {steps.index(0) + 2} repeats the value before it",
            "Publish once each time the value has changed: is publish(msg) there twice, or do two "
            "timers or two publishers send it?",
        )
    again = [
        index
        for index, item in enumerate(found)
        if index and same(found[0], item, parameters.tolerance)
    ]
    if again:
        return (
            f": it begins anew with message {again[0] + 1}",
            "Is the value set back, does it overflow, or do two publishers count?",
        )
    if 0 in steps:
        return (
            f": message {steps.index(0) + 2} repeats the value before it",
            "Publish once each time the value has changed.",
        )
    return "", "Change the value by the same step for every message."


def _listed(found: Sequence[Any], wanted: Sequence[Any]) -> tuple[str, str]:
    known = [item for item in wanted if item is not None]
    if sorted(map(repr, map(_plain, known))) == sorted(map(repr, map(_plain, found))):
        return ": the right values, but in another order", "Publish the values in the order asked."
    return "", "Publish the values that are asked for, each once and in this order."


def _plain(value: Any) -> Any:
    """A whole number as people write it."""
    if isinstance(value, float) and value.is_integer():
        return int(value)
    return (
        {key: _plain(item) for key, item in value.items()} if isinstance(value, Mapping) else value
    )
