"""Checks of what was published: how many messages, and with which values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Literal

from pydantic import Field, model_validator

from grader.checks.check import NamedFields, Parameters, Subject, check
from grader.checks.fields import FieldTolerance, toleranced
from grader.checks.finding import Evidence, Finding, Moment, Table
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
from grader.diagnosis.delivery import why_not_sent
from grader.diagnosis.explanation import explain
from grader.diagnosis.few_messages import why_few
from grader.diagnosis.no_messages import why_silent, why_unreadable
from grader.diagnosis.wrong_value import WrongValue, accumulates, was_integer
from grader.recording.model import Kind, Message, Recording
from grader.spec.name import TopicName

_MOST_FIELDS = 8
_ANSWER_HINT = (
    "Publish once in each call of the callback. Look for a second publish(), and for one that "
    "sends an answer again, such as that to the message before."
)
# rmw gives the largest number where it does not know a sequence number.
_SEQUENCE_LIMIT = 2**62


class Count(Parameters):
    """Parameters of messages.count."""

    needs = (Recorded(at_least="needed"), Published())

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
    moments = tuple(
        Moment(f"message {index}", recording.since_launch_s(message.stamp_ns))
        for index, message in enumerate(messages[:10], start=1)
    )
    lost = number - len(messages)
    observed = counted(number, "message") + (f" ({lost} of them lost on the way)" if lost else "")
    observed += per
    if high is not None and number > high * each:
        hint = _ANSWER_HINT if per else _many_hint(high)
        why = _why_many(recording, parameters.topic)
        return Finding.failed(expected, observed + why, hint, Evidence(moments=moments))
    return Finding.passed(expected, observed, Evidence(moments=moments))


def published(messages: tuple[Message, ...]) -> int:
    """How many messages were published: those received, or what the writer's numbers tell."""
    numbers = [message.sequence for message in messages if 0 < message.sequence < _SEQUENCE_LIMIT]
    return max([len(messages), *numbers])


def _why_many(recording: Recording, topic: str) -> str:
    publishers = recording.student_endpoints(Kind.PUBLISHER, topic)
    if len(publishers) > 1:
        nodes = sorted({item.node for item in publishers})
        return f" from {len(publishers)} publishers (in {codes(nodes)})"
    if recording.student_endpoints(Kind.SUBSCRIPTION, topic):
        return "; the node subscribes to the topic too, so it may answer its own messages"
    return ""


def _many_hint(high: int) -> str:
    if high == 1:
        return "Publish once, in the constructor, and call no timer and no second publish."
    return "Look for a second timer, a second publish() or a loop around it."


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


@check("messages.equal", Subject.RECORDING, Equal)
def equal(recording: Recording, parameters: Equal) -> Finding:
    """Every message has the expected values.

    Compares each field of each message on the topic. It does not matter whether a number was
    written as an integer.
    """
    messages = recording.on(parameters.topic)
    expected = _expected_words(parameters)
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
    wrong = {
        index: found
        for index, message in enumerate(messages, start=1)
        if (
            found := differences(
                wanted,
                message.value,
                rest_zero=parameters.rest == "zero",
                tolerance=parameters.tolerance,
            )
        )
    }
    if wrong:
        return _wrong(recording, parameters, expected, wrong)
    if len(messages) < parameters.at_least:
        return why_few(recording, parameters.topic, parameters.at_least).finding(expected)
    return Finding.passed(expected, f"all of {counted(len(messages), 'message')}")


def _expected_words(parameters: Equal) -> str:
    fields = ", ".join(f"{path} = {value_text(item)}" for path, item in _plain(parameters.value))
    rest = ", all else 0" if parameters.rest == "zero" else ""
    within = _within(parameters.tolerance)
    enough = f", {parameters.at_least} or more" if parameters.at_least > 1 else ""
    return f"{fields}{rest}{within} in every message on {code(parameters.topic)}{enough}"


def _within(tolerance: Tolerance) -> str:
    if not isinstance(tolerance, Mapping):
        return "" if tolerance <= 1e-6 else f" (within {tolerance:g})"
    parts = (f"{path} within {amount:g}" for path, amount in tolerance.items())
    return f" ({', '.join(parts)})" if tolerance else ""


def _plain(value: dict[str, Any], path: str = "") -> list[tuple[str, Any]]:
    found: list[tuple[str, Any]] = []
    for key, item in value.items():
        name = f"{path}.{key}" if path else key
        found.extend(_plain(item, name) if isinstance(item, dict) else [(name, item)])
    return found


def _wrong(
    recording: Recording,
    parameters: Equal,
    expected: str,
    wrong: dict[int, tuple[Difference, ...]],
) -> Finding:
    messages = recording.on(parameters.topic)
    first = min(wrong)
    found, message = wrong[first], messages[first - 1]
    fields = ", ".join(
        f"{item.field} = {value_text(item.observed)} instead of {value_text(item.expected)}"
        for item in found[:_MOST_FIELDS]
    )
    more = len(found) - _MOST_FIELDS
    explanation = _explanation(parameters, messages, wrong, first)
    observed = f"message {first} of {len(messages)} has {fields}"
    observed += f" and {counted(more, 'more wrong field')}" if more > 0 else ""
    observed += f": {explanation}" if explanation else ""
    if len(messages) > 1:
        observed += f" ({len(wrong)} of {counted(len(messages), 'message')} wrong)"
    rows = tuple(
        (item.field, value_text(item.expected), value_text(item.observed)) for item in found[:50]
    )
    return Finding.failed(
        expected,
        observed,
        _hint(messages, wrong, first),
        Evidence(
            moments=(
                Moment(f"message {first} is wrong", recording.since_launch_s(message.stamp_ns)),
            ),
            tables=(Table(f"Message {first}", ("field", "expected", "observed"), rows),),
        ),
    )


def _hint(
    messages: tuple[Message, ...], wrong: dict[int, tuple[Difference, ...]], first: int
) -> str:
    """What to try, by what was observed of the fields that are wrong in the first such message."""
    found = wrong[first]
    if any(was_integer(item.observed) for item in found):
        return "A number in a message must be a float: write 1.0 instead of 1, or float(value)."
    right = len(messages) - len(wrong)
    if right:
        return (
            f"{counted(right, 'message')} of {len(messages)} {'is' if right == 1 else 'are'} "
            "right. Look for what makes the others different: a counter, a condition, what is "
            "added up, or a second publish()."
        )
    every = "in every message" if len(messages) > 1 else "in it"
    values = [leaves(message.value) for message in messages]
    unset = [
        item.field
        for item in found
        if item.expected and all(not each.get(item.field, True) for each in values)
    ]
    if unset:
        return (
            f"{codes(unset[:_MOST_FIELDS])} {'is' if len(unset) == 1 else 'are'} 0 {every}, as in "
            "a new one: look where the program sets the fields before publish(msg), and to what."
        )
    which = codes([item.field for item in found[:_MOST_FIELDS]])
    if all(len({str(each.get(item.field)) for each in values}) == 1 for item in found):
        these, them = ("has this value", "it") if len(found) == 1 else ("have these values", "them")
        return f"{which} {these} {every}: look where the program sets {them} before publish(msg)."
    return (
        f"From message to message {which} {'changes' if len(found) == 1 else 'change'}, and "
        "every message must be right: look for a counter, and for what is added up."
    )


def _explanation(
    parameters: Equal,
    messages: tuple[Message, ...],
    wrong: dict[int, tuple[Difference, ...]],
    first: int,
) -> str:
    found = wrong[first]
    series = [leaves(message.value).get(found[0].field) for message in messages]
    if accumulates(found[0].expected, series):
        return f"{found[0].field} grows from message to message, as if added up"
    symptom = WrongValue(
        found,
        leaves(messages[first - 1].value),
        tolerance_of(parameters.tolerance, found[0].field),
        always=len(wrong) == len(messages),
    )
    return explain(symptom) or ""
