"""Values that follow one another: counting, or a list."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

from pydantic import Field, model_validator

from grader.checks.check import NamedFields, Parameters, Subject, check
from grader.checks.finding import Evidence, Finding, Moment, Table
from grader.checks.need import Recorded
from grader.checks.value import FieldPath, NoSuchField, number_at, same, value_at
from grader.checks.wording import code, counted, value_text
from grader.diagnosis.no_messages import why_few, why_silent
from grader.measure.numbering import is_numbered
from grader.recording.model import Recording
from grader.spec.name import TopicName

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
        which = f"{code(self.field)} of the messages on {code(self.topic)}"
        if self.values:
            listed = ", ".join(map(_text, self.values[:_SHOWN]))
            more = ", ..." if len(self.values) > _SHOWN else ""
            return f"{which}: {listed}{more}, in this order"
        begins = "" if self.start is None else f" from {_text(self.start)} on"
        verb = "counts" if self.step == 1 else f"grows by {_text(self.step)}"
        return f"{which} {verb}{begins}, message by message"


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
    read = value_at if parameters.values else number_at
    try:
        found = [read(message.value, parameters.field) for message in messages]
    except NoSuchField as error:
        return Finding.error(
            expected, f"the assignment expects what {messages[0].type} cannot be: {error}"
        )
    # Place of each message in all that its writer published, from 0.
    numbered = is_numbered(messages)
    places = [m.sequence - 1 if numbered else index for index, m in enumerate(messages)]
    wanted = _wanted(parameters, found, places)
    wrong = [
        index
        for index, value in enumerate(wanted)
        if value is not None and not same(value, found[index], parameters.tolerance)
    ]
    if wrong:
        return _failed(recording, parameters, found, wanted, wrong[0])
    if len(messages) < parameters.needed:
        return why_few(recording, parameters.topic, parameters.needed).finding(expected)
    if parameters.values and len(parameters.values) - 1 not in places:
        return Finding.to_repeat(
            expected, "the last of these messages was lost on its way to the probe"
        )
    return Finding.passed(
        expected,
        f"{_text(found[0])} to {_text(found[-1])} in {counted(len(found), 'message')}",
    )


def _wanted(parameters: Series, found: Sequence[Any], places: Sequence[int]) -> list[Any]:
    """The value that each message should have; None where any will do."""
    if parameters.step is None:
        values = parameters.values
        return [values[place] if place < len(values) else None for place in places]
    start, begin = (found[0], places[0]) if parameters.start is None else (parameters.start, 0)
    return [start + parameters.step * (place - begin) for place in places]


def _failed(
    recording: Recording,
    parameters: Series,
    found: Sequence[Any],
    wanted: Sequence[Any],
    first: int,
) -> Finding:
    why, hint = _explanation(parameters, found)
    when_s = recording.since_launch_s(recording.on(parameters.topic)[first].stamp_ns)
    rows = tuple(
        (str(number), "any" if want is None else _text(want), _text(have))
        for number, (want, have) in enumerate(zip(wanted, found, strict=True), start=1)
    )
    title, header = f"{parameters.field} of {parameters.topic}", ("message", "expected", "observed")
    return Finding.failed(
        parameters.words,
        f"{code(parameters.field)} is {_text(found[first])} instead of {_text(wanted[first])} in "
        f"message {first + 1} of {len(found)}{why}",
        hint,
        Evidence(
            moments=(Moment(f"message {first + 1} is wrong", when_s),),
            tables=(Table(title, header, rows[:50]),),
        ),
    )


def _explanation(parameters: Series, found: Sequence[Any]) -> tuple[str, str]:
    """What the values tell, as a clause, and what to try."""
    if parameters.step is None:
        return "", "Publish the values that are asked for, each once and in this order."
    hint = "Change the value once for every message, by what is asked for."
    steps = [b - a for a, b in pairwise(found)]
    if steps and not any(steps):
        return (
            ": the value never changes",
            "Keep the value in an attribute of the node, such as self.count, and change it in the "
            "timer's callback.",
        )
    if steps and all(same(steps[0], item, parameters.tolerance) for item in steps):
        grows = f"it begins with {_text(found[0])} and grows by {_text(steps[0])}"
        return f": {grows} from message to message", hint
    if found[0] in found[1:] and steps[0]:
        return (
            f": it begins anew with message {found.index(found[0], 1) + 1}",
            "Is the value set back, does it overflow, or do two publishers count?",
        )
    return "", hint


def _text(value: Any) -> str:
    """A value as people write it, whole numbers without a decimal point."""
    is_whole = isinstance(value, float) and value.is_integer()
    return value_text(int(value) if is_whole else value)
