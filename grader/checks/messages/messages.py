"""Checks of what was published: how many messages, with which values, in which order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, Literal

from pydantic import Field, model_validator

from grader.checks.check import NamedFields, Parameters, Subject, check, stop_if, toleranced
from grader.checks.need import PUBLISHED, Recorded
from grader.diagnosis.explanation import explain
from grader.diagnosis.no_messages import why_few, why_not_sent, why_silent, why_unreadable
from grader.diagnosis.wrong_value import FLOAT_HINT, WrongValue, accumulates, was_integer
from grader.findings.fields import (
    FieldTolerance,
    difference_table,
    instead,
    wanted_text,
    within_words,
    words,
)
from grader.findings.finding import Evidence, Finding, Moment, Table
from grader.findings.value import (
    EXACT,
    Difference,
    FieldPath,
    differences,
    expected_leaves,
    item_at,
    leaves,
    number_at,
    same,
    tolerance_of,
)
from grader.findings.wording import code, codes, counted
from grader.findings.words import worded
from grader.measure.numbering import is_numbered, published
from grader.recording.model import Kind, Recording
from grader.spec.expression import Expression
from grader.spec.name import TopicName

_MOST_FIELDS = 8


class Count(Parameters):
    """Parameters of messages.count."""

    about = ("published", "subscription")
    needs = (Recorded(), PUBLISHED)

    topic: TopicName = Field(description="Fully qualified topic name.")
    exactly: int | None = Field(None, ge=0, description="Exact number of messages.")
    at_least: int | None = Field(None, ge=1, description="Least number of messages.")
    at_most: int | None = Field(None, ge=0, description="Largest number of messages.")
    stimulus: TopicName | None = Field(
        None,
        description="Topic on which the probe publishes. The numbers then apply to each message of "
        "the probe. Messages from before the probe's first message do not count.",
    )

    @model_validator(mode="after")
    def _sensible(self) -> Count:
        if self.exactly is None and self.at_least is None and self.at_most is None:
            raise ValueError("say how many: exactly, at_least or at_most")
        if self.exactly is not None and (self.at_least, self.at_most) != (None, None):
            raise ValueError("'exactly' cannot be used with 'at_least' or 'at_most'")
        low, high = self.bounds
        if high is not None and low > high:
            raise ValueError(f"at_least ({low}) is more than at_most ({high})")
        return self

    @property
    def bounds(self) -> tuple[int, int | None]:
        """Lowest and highest number allowed; None for no limit."""
        if self.exactly is not None:
            return self.exactly, self.exactly
        return self.at_least or 0, self.at_most

    def _asked(self) -> str:
        low, high = self.bounds
        if low == high:
            text = f"exactly {counted(low, 'message')}"
        elif high is None:
            text = f"at least {counted(low, 'message')}"
        elif low:
            text = f"{low} to {high} messages"
        else:
            text = f"at most {counted(high, 'message')}"
        each = f" for each message on {code(self.stimulus)}" if self.stimulus else ""
        return f"{text} on {code(self.topic)}{each}"


@check("messages.count", Subject.RECORDING, Count)
def count(recording: Recording, parameters: Count) -> Finding:
    """The right number of messages is published.

    Counts the messages on the topic in the whole observation, or since the first message of a
    stimulus that they answer. A message that was sent but lost in transit counts as published.
    """
    everything = recording.on(parameters.topic)
    messages, each, per = everything, 1, ""
    if parameters.stimulus is not None:
        sent = recording.sent.get(parameters.stimulus, ())
        if not sent:
            return why_not_sent(recording, parameters.stimulus)
        messages = tuple(item for item in everything if item.stamp_ns >= sent[0].stamp_ns)
        each = len(sent)
        per = f" for {counted(each, 'message')} on {code(parameters.stimulus)}"
    low, high = parameters.bounds
    early = len(everything) - len(messages)
    number = published(everything) - early
    if number < low * each:
        return why_few(recording, parameters.topic, low * each + early)
    evidence = Evidence(
        moments=tuple(
            Moment(f"message {index}", recording.since_launch_s(message.stamp_ns))
            for index, message in enumerate(messages[:10], start=1)
        )
    )
    lost = number - len(messages)
    observed = counted(number, "message") + (f" ({lost} of them lost on the way)" if lost else "")
    observed += per
    if high is None or number <= high * each:
        return Finding.passed(parameters.asked_for, observed, evidence)
    publishers = recording.student_endpoints(Kind.PUBLISHER, parameters.topic)
    if len(publishers) > 1:
        nodes = codes(sorted({item.node for item in publishers}))
        observed += f" from {len(publishers)} publishers (in {nodes})"
    if per:
        hint = "Publish once in each call of the callback: look for a second publish()."
    elif high == 1:
        hint = "Publish once, in the constructor: call publish() nowhere else, and in no loop."
    else:
        hint = "Look for a second publish() or a loop around it, and for what calls it too often."
    return Finding(observed, hint, evidence)


class Equal(Parameters):
    """Parameters of messages.equal."""

    about = ("published", "subscription")
    needs = (Recorded(),)

    topic: TopicName = Field(description="Fully qualified topic name.")
    value: dict[str, Any] = Field(
        min_length=1,
        description="Expected fields, nested (`{linear: {x: 1.0}}`) or by path "
        "(`{linear.x: 1.0}`).",
    )
    rest: Literal["zero", "any"] = Field(
        "zero", description="Expected value of the fields that `value` does not name."
    )
    tolerance: FieldTolerance = EXACT
    at_least: int = Field(1, ge=1, description="Least number of messages needed to judge.")

    def named_fields(self) -> Iterator[NamedFields]:
        """The expected fields."""
        return toleranced("value", self.topic, self.value, self.tolerance)

    def _asked(self) -> str:
        rest = ", all else 0" if self.rest == "zero" else ""
        enough = f", {self.at_least} or more" if self.at_least > 1 else ""
        return (
            f"{words(self.value)}{rest}{within_words(self.tolerance)} in every message on "
            f"{code(self.topic)}{enough}"
        )


@check("messages.equal", Subject.RECORDING, Equal)
def equal(recording: Recording, parameters: Equal) -> Finding:
    """Every message has the expected values.

    Compares each field of each message on the topic. It does not matter whether a number is an
    integer or a float.
    """
    messages = recording.on(parameters.topic)
    if not messages:
        return why_silent(recording, parameters.topic)
    stop_if(why_unreadable(recording, parameters.topic))
    wanted = expected_leaves(parameters.value, messages[0].value)
    rest_zero = parameters.rest == "zero"
    found = [
        differences(wanted, item.value, rest_zero=rest_zero, tolerance=parameters.tolerance)
        for item in messages
    ]
    if any(found):
        return _wrong(recording, parameters, found)
    if len(messages) < parameters.at_least:
        return why_few(recording, parameters.topic, parameters.at_least)
    return Finding.passed(parameters.asked_for, f"all of {counted(len(messages), 'message')}")


def _wrong(
    recording: Recording, parameters: Equal, by_message: list[tuple[Difference, ...]]
) -> Finding:
    """The finding of messages of which some have differences."""
    messages = recording.on(parameters.topic)
    wrong = sum(map(bool, by_message))
    first, found = next(item for item in enumerate(by_message, start=1) if item[1])
    observed = f"message {first} of {len(messages)} has "
    observed += ", ".join(map(instead, found[:_MOST_FIELDS]))
    more = len(found) - _MOST_FIELDS
    observed += f" and {counted(more, 'more wrong field')}" if more > 0 else ""
    field, message = found[0].field, messages[first - 1]
    if accumulates(found[0].expected, [leaves(item.value).get(field) for item in messages]):
        observed += f": {field} grows from message to message, as if added up"
    else:
        tolerance = tolerance_of(parameters.tolerance, field)
        always = wrong == len(messages)
        clause = explain(WrongValue(found, leaves(message.value), tolerance, always))
        observed += f": {clause}" if clause else ""
    if len(messages) > 1:
        observed += f" ({wrong} of {counted(len(messages), 'message')} wrong)"
    when_s = recording.since_launch_s(message.stamp_ns)
    return Finding(
        observed,
        _hint(found, len(messages), len(messages) - wrong),
        Evidence(
            moments=(Moment(f"message {first} is wrong", when_s),),
            tables=(difference_table(f"Message {first}", found),),
        ),
    )


def _hint(found: tuple[Difference, ...], number: int, right: int) -> str:
    if any(was_integer(item.observed) for item in found):
        return str(FLOAT_HINT)
    if right:
        return (
            f"{counted(right, 'message')} of {number} {'is' if right == 1 else 'are'} right. Look "
            "for what makes the others different: a counter, a condition, what is added up, or a "
            "second publish()."
        )
    fields = codes([item.field for item in found[:_MOST_FIELDS]])
    return f"Look where the program sets {fields} before publish(msg), and to what."


class Series(Parameters):
    """Parameters of messages.sequence."""

    about = ("published", "subscription")
    needs = (Recorded(),)

    topic: TopicName = Field(description="Fully qualified topic name.")
    field: FieldPath = Field(description="The field that changes, such as `data`.")
    values: tuple[float | str | bool, ...] = Field(
        (), description="The values of the first messages, in order."
    )
    step: float | None = Field(
        None, description="Instead of `values`: how much the value grows in each message."
    )
    start: float | None = Field(
        None, description="With `step`: the value in the first message; by default any."
    )
    tolerance: float = Field(
        1e-9, ge=0, allow_inf_nan=False, description="Largest difference of two numbers."
    )
    at_least: int = Field(
        3, ge=1, description="With `step`: least number of messages needed to judge."
    )

    @model_validator(mode="after")
    def _one_way(self) -> Series:
        if bool(self.values) == (self.step is not None):
            raise ValueError("give either 'values' or 'step'")
        if self.start is not None and self.step is None:
            raise ValueError("'start' needs 'step'")
        return self

    def named_fields(self) -> Iterator[NamedFields]:
        """The field, with each of its values."""
        yield NamedFields(("field",), self.topic, self.field)
        for number, value in enumerate(self.values):
            yield NamedFields(
                ("values", number), self.topic, {self.field: value}, tolerance=self.tolerance
            )

    def _asked(self) -> str:
        which = f"{code(self.field)} of the messages on {code(self.topic)}"
        if self.values:
            return f"{which}: {', '.join(map(_text, self.values))}, in this order"
        begins = "" if self.start is None else f"begins with {_text(self.start)} and "
        return f"{which} {begins}grows by {_text(self.step)} from message to message"


@check("messages.sequence", Subject.RECORDING, Series)
def sequence(recording: Recording, parameters: Series) -> Finding:
    """The values come in the right order.

    Compares one field of each message with the value that it should have at its place: counting by
    a `step`, or a list of `values`. A message that was sent but lost in transit keeps its place.
    """
    messages = recording.on(parameters.topic)
    if not messages:
        return why_silent(recording, parameters.topic)
    read = item_at if parameters.values else number_at
    found = [read(message.value, parameters.field) for message in messages]
    # Place of each message in all that its writer published, from 0.
    numbered = is_numbered(messages)
    places = [m.sequence - 1 if numbered else index for index, m in enumerate(messages)]
    wanted = _wanted_values(parameters, found, places)
    tolerance, circle = parameters.tolerance, Expression.of(parameters.field).circle
    wrong = [
        index
        for index, value in enumerate(wanted)
        if value is not None
        and not same(value, found[index], tolerance, messages[index].value, circle)
    ]
    if wrong:
        return _wrong_order(recording, parameters, found, wanted, wrong[0])
    needed = len(parameters.values) or parameters.at_least
    if len(messages) < needed:
        return why_few(recording, parameters.topic, needed)
    if parameters.values and len(parameters.values) - 1 not in places:
        return Finding.undecided("the last of these messages was lost in transit")
    return Finding.passed(
        parameters.asked_for,
        f"{_text(found[0])} to {_text(found[-1])} in {counted(len(found), 'message')}",
    )


def _wanted_values(parameters: Series, found: Sequence[Any], places: Sequence[int]) -> list[Any]:
    """The value that each message should have; None where any will do."""
    if parameters.step is None:
        values = parameters.values
        return [values[place] if place < len(values) else None for place in places]
    start, begin = (found[0], places[0]) if parameters.start is None else (parameters.start, 0)
    return [start + parameters.step * (place - begin) for place in places]


def _wrong_order(
    recording: Recording,
    parameters: Series,
    found: Sequence[Any],
    wanted: Sequence[Any],
    first: int,
) -> Finding:
    why, hint = _explain_order(parameters, found)
    when_s = recording.since_launch_s(recording.on(parameters.topic)[first].stamp_ns)
    rows = tuple(
        (str(number), "any" if want is None else _text(want), _text(have))
        for number, (want, have) in enumerate(zip(wanted, found, strict=True), start=1)
    )
    title, header = f"{parameters.field} of {parameters.topic}", ("message", "expected", "observed")
    return Finding(
        f"{code(parameters.field)} is {_text(found[first])} instead of {_text(wanted[first])} in "
        f"message {first + 1} of {len(found)}{why}",
        hint,
        Evidence(
            moments=(Moment(f"message {first + 1} is wrong", when_s),),
            tables=(Table(title, header, rows[:50]),),
        ),
    )


def _explain_order(parameters: Series, found: Sequence[Any]) -> tuple[str, str]:
    """What the values tell, as a clause, and what to try."""
    if parameters.step is None:
        return "", "Publish the values that are asked for, each once and in this order."
    hint = f"Change the value once for every message, by {_text(parameters.step)}."
    steps = [b - a for a, b in pairwise(found)]
    if steps and not any(steps):
        an_attribute = worded(
            python="an attribute of the node, such as self.count",
            cpp="a member of the node, such as count_",
        )
        return (
            ": the value never changes",
            f"Keep the value in {an_attribute}, and change it in the timer's callback.",
        )
    if steps and all(same(steps[0], item, parameters.tolerance) for item in steps):
        grows = f"it begins with {_text(found[0])} and grows by {_text(steps[0])}"
        return f": {grows} from message to message", hint
    if found[0] in found[1:] and steps[0]:
        return (
            f": it goes back to the first value in message {found.index(found[0], 1) + 1}",
            "Is the value reset, does it overflow, or do two publishers count?",
        )
    return "", hint


def _text(value: Any) -> str:
    """A value as people write it, whole numbers without a decimal point."""
    is_whole = isinstance(value, float) and value.is_integer()
    return wanted_text(int(value) if is_whole else value)
