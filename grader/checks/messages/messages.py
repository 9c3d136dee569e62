"""Checks of what was published: how many messages, with which values, in which order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Literal

from pydantic import Field, model_validator

from grader.checks.check import NamedFields, Parameters, Subject, check, stop_if, toleranced
from grader.checks.need import PUBLISHED, Recorded
from grader.diagnosis.explanation import cause_of, explain, mistaken
from grader.diagnosis.no_messages import why_few, why_not_sent, why_silent, why_unreadable
from grader.diagnosis.wrong_order import WrongOrder, plain
from grader.diagnosis.wrong_value import WrongValue, was_integer
from grader.findings.expected import Difference, differences, expected_leaves, same
from grader.findings.fields import FieldTolerance, difference_table, instead, within_words, words
from grader.findings.finding import Evidence, Finding, Table, moment
from grader.findings.value import EXACT, FieldPath, item_at, leaves, number_at, tolerance_of
from grader.findings.words import code, codes, counted
from grader.measure.numbering import is_numbered, published
from grader.recording.model import Kind, Message, Recording
from grader.spec.expression import Expression
from grader.spec.name import TopicName

_MOST_FIELDS = 8
_MOST_MOMENTS = 10
_MOST_ROWS = 50


class Count(Parameters):
    """Parameters of messages.count."""

    of_bags = True
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
    everything = messages = recording.on(parameters.topic)
    low, high = parameters.bounds
    for_each = ""
    if parameters.stimulus is not None:
        sent = recording.sent.get(parameters.stimulus, ())
        if not sent:
            return why_not_sent(recording, parameters.stimulus)
        messages = tuple(item for item in everything if item.stamp_ns >= sent[0].stamp_ns)
        low, high = low * len(sent), None if high is None else high * len(sent)
        for_each = f" for {counted(len(sent), 'message')} on {code(parameters.stimulus)}"
    early = len(everything) - len(messages)
    number = published(everything) - early
    if number < low:
        return why_few(recording, parameters.topic, low + early)
    observed = counted(number, "message")
    if number > len(messages):
        observed += f" ({number - len(messages)} of them lost on the way)"
    observed += for_each
    first = enumerate(messages[:_MOST_MOMENTS], start=1)
    evidence = Evidence(
        moments=tuple(moment(recording, f"message {index}", one.stamp_ns) for index, one in first)
    )
    if high is None or number <= high:
        return Finding.as_asked(observed, evidence)
    publishers = recording.student_endpoints(Kind.PUBLISHER, parameters.topic)
    if len(publishers) > 1:
        nodes = codes(sorted({item.node for item in publishers}))
        observed += f" from {len(publishers)} publishers (in {nodes})"
    if for_each:
        return mistaken("once_per_call", observed, evidence)
    return mistaken("once" if high == 1 else "too_many", observed, evidence)


class Equal(Parameters):
    """Parameters of messages.equal."""

    of_bags = True
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
    return Finding.as_asked(f"all of {counted(len(messages), 'message')}")


def _wrong(
    recording: Recording, parameters: Equal, by_message: list[tuple[Difference, ...]]
) -> Finding:
    """The finding of messages of which some have differences."""
    messages = recording.on(parameters.topic)
    wrong = sum(map(bool, by_message))
    right = len(messages) - wrong
    number, found = next(item for item in enumerate(by_message, start=1) if item[1])
    message = messages[number - 1]
    observed = f"message {number} of {len(messages)} has "
    observed += ", ".join(map(instead, found[:_MOST_FIELDS]))
    if len(found) > _MOST_FIELDS:
        observed += f" and {counted(len(found) - _MOST_FIELDS, 'more wrong field')}"
    clause = _why_wrong(parameters, messages, message, found, all_wrong=not right)
    if clause:
        observed += f": {clause}"
    if len(messages) > 1:
        observed += f" ({wrong} of {counted(len(messages), 'message')} wrong)"
    first_wrong = moment(recording, f"message {number} is wrong", message.stamp_ns)
    shown = Evidence((first_wrong,), tables=(difference_table(f"Message {number}", found),))
    if any(was_integer(item.observed) for item in found):
        return mistaken("float_field", observed, shown)
    if right:
        words = f"{counted(right, 'message')} of {len(messages)} {'is' if right == 1 else 'are'}"
        return mistaken("some_wrong", observed, shown, right=words)
    fields = codes([item.field for item in found[:_MOST_FIELDS]])
    return mistaken("all_wrong", observed, shown, fields=fields)


def _why_wrong(
    parameters: Equal,
    messages: Sequence[Message],
    message: Message,
    found: tuple[Difference, ...],
    *,
    all_wrong: bool,
) -> str | None:
    """Why the values of a message are wrong, as a part of a sentence; None if nothing tells."""
    field = found[0].field
    series = [leaves(one.value).get(field) for one in messages]
    tolerance = tolerance_of(parameters.tolerance, field)
    return explain(WrongValue(found, leaves(message.value), tolerance, all_wrong, series))


class Series(Parameters):
    """Parameters of messages.sequence."""

    of_bags = True
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
            return f"{which}: {', '.join(map(plain, self.values))}, in this order"
        begins = "" if self.start is None else f"begins with {plain(self.start)} and "
        return f"{which} {begins}grows by {plain(self.step)} from message to message"


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
    if is_numbered(messages):
        places = [message.sequence - 1 for message in messages]
    else:
        places = list(range(len(messages)))
    wanted = _wanted_values(parameters, found, places)
    circle = Expression.of(parameters.field).circle
    is_right = [
        value is None or same(value, seen, parameters.tolerance, message.value, circle)
        for value, seen, message in zip(wanted, found, messages, strict=True)
    ]
    if not all(is_right):
        return _wrong_order(recording, parameters, found, wanted, is_right.index(False))
    needed = len(parameters.values) or parameters.at_least
    if len(messages) < needed:
        return why_few(recording, parameters.topic, needed)
    if parameters.values and len(parameters.values) - 1 not in places:
        return Finding.undecided("the last of these messages was lost in transit")
    return Finding.as_asked(
        f"{plain(found[0])} to {plain(found[-1])} in {counted(len(found), 'message')}"
    )


def _wanted_values(parameters: Series, found: Sequence[Any], places: Sequence[int]) -> list[Any]:
    """The value that each message should have; None where any will do."""
    if parameters.step is None:
        values = parameters.values
        return [values[place] if place < len(values) else None for place in places]
    if parameters.start is None:
        start, begin = found[0], places[0]
    else:
        start, begin = parameters.start, 0
    return [start + parameters.step * (place - begin) for place in places]


def _wrong_order(
    recording: Recording,
    parameters: Series,
    found: Sequence[Any],
    wanted: Sequence[Any],
    first: int,
) -> Finding:
    cause = cause_of(WrongOrder(found, parameters.step, parameters.tolerance))
    sent_ns = recording.on(parameters.topic)[first].stamp_ns
    wrong_one = moment(recording, f"message {first + 1} is wrong", sent_ns)
    rows = tuple(
        (str(number), "any" if want is None else plain(want), plain(have))
        for number, (want, have) in enumerate(zip(wanted, found, strict=True), start=1)
    )
    title, header = f"{parameters.field} of {parameters.topic}", ("message", "expected", "observed")
    return Finding(
        f"{code(parameters.field)} is {plain(found[first])} instead of {plain(wanted[first])} in "
        f"message {first + 1} of {len(found)}{cause.observed}",
        cause.hint,
        Evidence((wrong_one,), tables=(Table(title, header, rows[:_MOST_ROWS]),)),
    )
