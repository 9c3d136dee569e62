"""Checks of what was published: how many messages, and with which values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Literal

from pydantic import Field, model_validator

from grader.checks.check import NamedFields, Parameters, Subject, check
from grader.checks.fields import FieldTolerance, difference_table, toleranced, words
from grader.checks.finding import Evidence, Finding, Moment
from grader.checks.need import Published, Recorded
from grader.checks.value import (
    EXACT,
    Difference,
    NoSuchField,
    Tolerance,
    differences,
    expected_leaves,
    leaves,
    tolerance_of,
)
from grader.checks.wording import code, codes, counted, value_text
from grader.diagnosis.explanation import explain
from grader.diagnosis.no_messages import why_few, why_not_sent, why_silent, why_unreadable
from grader.diagnosis.wrong_value import WrongValue, accumulates, was_integer
from grader.measure.numbering import published
from grader.recording.model import Kind, Message, Recording
from grader.spec.name import TopicName

_MOST_FIELDS = 8


class Count(Parameters):
    """Parameters of messages.count."""

    needs = (Recorded(), Published())

    topic: TopicName = Field(description="Fully qualified topic name.")
    exactly: int | None = Field(None, ge=0, description="So many messages, no more, no fewer.")
    at_least: int | None = Field(None, ge=1, description="At least so many messages.")
    at_most: int | None = Field(None, ge=0, description="At most so many messages.")
    stimulus: TopicName | None = Field(
        None,
        description="Topic on which the probe publishes: so many messages for each of the probe's. "
        "What came before the first of these does not count.",
    )

    @model_validator(mode="after")
    def _sensible(self) -> Count:
        if self.exactly is None and self.at_least is None and self.at_most is None:
            raise ValueError("say how many: exactly, at_least or at_most")
        if self.exactly is not None and (self.at_least, self.at_most) != (None, None):
            raise ValueError("exactly stands alone, without at_least and at_most")
        low, high = self.bounds
        if high is not None and low > high:
            raise ValueError(f"at_least ({low}) is more than at_most ({high})")
        return self

    @property
    def needed(self) -> int:
        """How many messages must come for it to pass."""
        return self.bounds[0]

    @property
    def bounds(self) -> tuple[int, int | None]:
        """Lowest and highest number allowed; None for no limit."""
        if self.exactly is not None:
            return self.exactly, self.exactly
        return self.at_least or 0, self.at_most

    @property
    def words(self) -> str:
        """What is expected, in words."""
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
    stimulus that they answer. A message that the writer numbered but that was lost on its way
    counts as published.
    """
    expected = parameters.words
    everything = recording.on(parameters.topic)
    messages, each, per = everything, 1, ""
    if parameters.stimulus is not None:
        sent = recording.sent.get(parameters.stimulus, ())
        if not sent:
            return why_not_sent(recording, parameters.stimulus).finding(expected)
        messages = tuple(item for item in everything if item.stamp_ns >= sent[0].stamp_ns)
        each = len(sent)
        per = f" for {counted(each, 'message')} on {code(parameters.stimulus)}"
    low, high = parameters.bounds
    early = len(everything) - len(messages)
    number = published(everything) - early
    if number < low * each:
        return why_few(recording, parameters.topic, low * each + early).finding(expected)
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
        return Finding.passed(expected, observed, evidence)
    publishers = recording.student_endpoints(Kind.PUBLISHER, parameters.topic)
    if len(publishers) > 1:
        nodes = codes(sorted({item.node for item in publishers}))
        observed += f" from {len(publishers)} publishers (in {nodes})"
    if per:
        hint = "Publish once in each call of the callback: look for a second publish()."
    elif high == 1:
        hint = "Publish once, in the constructor, and call no timer and no second publish."
    else:
        hint = "Look for a second timer, a second publish() or a loop around it."
    return Finding.failed(expected, observed, hint, evidence)


class Equal(Parameters):
    """Parameters of messages.equal."""

    needs = (Recorded(),)

    topic: TopicName = Field(description="Fully qualified topic name.")
    value: dict[str, Any] = Field(
        min_length=1,
        description="Expected fields, nested (`{linear: {x: 1.0}}`) or by path "
        "(`{linear.x: 1.0}`).",
    )
    rest: Literal["zero", "any"] = Field(
        "zero", description="What every field must be that `value` does not name."
    )
    tolerance: FieldTolerance = EXACT
    at_least: int = Field(1, ge=1, description="How many messages must have come to judge.")

    def named_fields(self) -> Iterator[NamedFields]:
        """The expected fields."""
        return toleranced("value", self.topic, self.value, self.tolerance)

    @property
    def words(self) -> str:
        """What is expected, in words."""
        rest = ", all else 0" if self.rest == "zero" else ""
        enough = f", {self.at_least} or more" if self.at_least > 1 else ""
        return (
            f"{words(self.value)}{rest}{_within(self.tolerance)} in every message on "
            f"{code(self.topic)}{enough}"
        )


def _within(tolerance: Tolerance) -> str:
    if not isinstance(tolerance, Mapping):
        return "" if tolerance <= 1e-6 else f" (within {tolerance:g})"
    parts = (f"{path} within {amount:g}" for path, amount in tolerance.items())
    return f" ({', '.join(parts)})" if tolerance else ""


@check("messages.equal", Subject.RECORDING, Equal)
def equal(recording: Recording, parameters: Equal) -> Finding:
    """Every message has the expected values.

    Compares each field of each message on the topic. It does not matter whether a number was
    written as an integer.
    """
    messages = recording.on(parameters.topic)
    expected = parameters.words
    if not messages:
        return why_silent(recording, parameters.topic).finding(expected)
    unreadable = why_unreadable(recording, parameters.topic)
    if unreadable is not None:
        return unreadable.finding(expected)
    try:
        wanted = expected_leaves(parameters.value, messages[0].value)
    except NoSuchField as error:
        return Finding.error(
            expected, f"the assignment expects what {messages[0].type} cannot be: {error}"
        )
    rest_zero = parameters.rest == "zero"
    found = [
        differences(wanted, item.value, rest_zero=rest_zero, tolerance=parameters.tolerance)
        for item in messages
    ]
    if any(found):
        return _wrong(recording, parameters, found)
    if len(messages) < parameters.at_least:
        return why_few(recording, parameters.topic, parameters.at_least).finding(expected)
    return Finding.passed(expected, f"all of {counted(len(messages), 'message')}")


def _wrong(
    recording: Recording, parameters: Equal, by_message: list[tuple[Difference, ...]]
) -> Finding:
    """The finding of messages of which some have differences."""
    messages = recording.on(parameters.topic)
    wrong = sum(map(bool, by_message))
    first, found = next(item for item in enumerate(by_message, start=1) if item[1])
    observed = f"message {first} of {len(messages)} has " + ", ".join(
        f"{item.field} = {value_text(item.observed)} instead of {value_text(item.expected)}"
        for item in found[:_MOST_FIELDS]
    )
    more = len(found) - _MOST_FIELDS
    observed += f" and {counted(more, 'more wrong field')}" if more > 0 else ""
    explanation = _explanation(parameters, messages, found, messages[first - 1], wrong)
    observed += f": {explanation}" if explanation else ""
    if len(messages) > 1:
        observed += f" ({wrong} of {counted(len(messages), 'message')} wrong)"
    when_s = recording.since_launch_s(messages[first - 1].stamp_ns)
    return Finding.failed(
        parameters.words,
        observed,
        _hint(found, len(messages), len(messages) - wrong),
        Evidence(
            moments=(Moment(f"message {first} is wrong", when_s),),
            tables=(difference_table(f"Message {first}", found),),
        ),
    )


def _hint(found: tuple[Difference, ...], number: int, right: int) -> str:
    if any(was_integer(item.observed) for item in found):
        return "A number in a message must be a float: write 1.0 instead of 1, or float(value)."
    if right:
        return (
            f"{counted(right, 'message')} of {number} {'is' if right == 1 else 'are'} right. Look "
            "for what makes the others different: a counter, a condition, what is added up, or a "
            "second publish()."
        )
    fields = codes([item.field for item in found[:_MOST_FIELDS]])
    return f"Look where the program sets {fields} before publish(msg), and to what."


def _explanation(
    parameters: Equal,
    messages: tuple[Message, ...],
    found: tuple[Difference, ...],
    message: Message,
    wrong: int,
) -> str:
    field = found[0].field
    if accumulates(found[0].expected, [leaves(item.value).get(field) for item in messages]):
        return f"{field} grows from message to message, as if added up"
    tolerance = tolerance_of(parameters.tolerance, field)
    always = wrong == len(messages)
    return explain(WrongValue(found, leaves(message.value), tolerance, always=always)) or ""
