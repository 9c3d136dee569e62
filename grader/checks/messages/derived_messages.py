"""Messages that should be made of other messages, each with those that it may be made of."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise

from grader.checks.field import number_at, value_at
from grader.checks.messages.source_value import SourceValue
from grader.checks.value import NoSuchField
from grader.recording.model import NS, Message, Recording

# rmw gives the largest number where it does not know a sequence number.
_SEQUENCE_LIMIT = 2**62


@dataclass(frozen=True)
class Sample:
    """A message with the sources that it may be made of.

    Attributes:
        number: Which message on its topic, from 1.
        values: The numbers in its fields; NaN for one that is not there.
        window: Indices of those sources; the last one is the newest that there was.
        excused: How many of them, the oldest, are right only by what the host took.
        is_known: Whether the recording has all of those sources. It may lack one that was lost
            on its way, and what was published after the newest one that it has.
    """

    number: int
    message: Message
    values: tuple[float, ...]
    window: range
    excused: int
    is_known: bool


@dataclass(frozen=True)
class DerivedMessages:
    """All messages of a topic against those of another one.

    Attributes:
        sources: The messages that they come from, oldest first; at least one.
    """

    fields: tuple[str, ...]
    values: tuple[SourceValue, ...]
    tolerance: float
    sources: tuple[Message, ...]
    table: tuple[tuple[float, ...], ...]
    samples: tuple[Sample, ...]

    @classmethod
    def of(
        cls,
        recording: Recording,
        messages: Sequence[Message],
        sources: tuple[Message, ...],
        fields: Mapping[str, str],
        tolerance: float,
        within_s: float,
    ) -> DerivedMessages:
        """Look up which sources each message may be made of.

        Args:
            recording: The run; what the host took from the node makes older sources right.
            sources: Oldest first; at least one.

        Raises:
            NoSuchField: A field does not exist, or holds no number.
        """
        values = tuple(map(SourceValue.of, fields.values()))
        table = tuple(tuple(one.number(item.value) for one in values) for item in sources)
        stamps = [item.stamp_ns for item in sources]
        # How many were lost before each.
        lost = [0, *accumulate(_lost(before, after) for before, after in pairwise(sources))]
        within_ns = round(within_s * NS)
        samples = []
        for number, message in enumerate(messages, start=1):
            numbers = tuple(_number(message, field) for field in fields)
            last = bisect_right(stamps, message.stamp_ns)
            if not last:
                continue
            due_ns = message.stamp_ns - within_ns
            begin_ns = due_ns - round(recording.stolen_s(due_ns, message.stamp_ns) * NS)
            # Where the source is silent its newest values stay the right ones.
            first, due = (min(bisect_left(stamps, at), last - 1) for at in (begin_ns, due_ns))
            is_known = last < len(sources) and lost[first] == lost[last]
            window = range(first, last)
            samples.append(Sample(number, message, numbers, window, due - first, is_known))
        return cls(tuple(fields), values, tolerance, sources, table, tuple(samples))

    def fits(
        self, sample: Sample, window: range | None = None, fields: Sequence[int] | None = None
    ) -> bool:
        """Whether the values of a message are those of one source.

        Args:
            window: Sources to look at; by default its own window.
            fields: Indices of the fields to look at; by default all.
        """
        indices = range(len(self.fields)) if fields is None else fields
        rows = sample.window if window is None else window
        return any(
            all(
                self.equal(index, sample.values[index], self.table[row][index]) for index in indices
            )
            for row in reversed(rows)
        )

    def equal(self, index: int, observed: float, wanted: float) -> bool:
        """Whether a number is the wanted one; NaN never is."""
        return abs(self.values[index].error(observed, wanted)) <= self.tolerance

    def nearest(self, sample: Sample) -> int:
        """The source in a message's window that its values are most like."""

        def distance(row: int) -> float:
            errors = (
                abs(value.error(observed, wanted))
                for value, observed, wanted in zip(
                    self.values, sample.values, self.table[row], strict=True
                )
            )
            total = sum(errors)
            return total if math.isfinite(total) else math.inf

        return min(reversed(sample.window), key=distance)

    def error(self, sample: Sample, index: int) -> float:
        """How far the value of one field is off, at best."""
        errors = (
            self.values[index].error(sample.values[index], self.table[row][index])
            for row in sample.window
        )
        return min(errors, key=abs)


def _number(message: Message, field: str) -> float:
    """The number in a field; NaN for an item that an array of the student's does not have.

    Raises:
        NoSuchField: The type has no such field, or it holds no number.
    """
    try:
        return number_at(message.value, field)
    except NoSuchField:
        array = field.rpartition("[")[0]
        if array and _is_short(message, array):
            return math.nan
        raise


def _is_short(message: Message, array: str) -> bool:
    try:
        return isinstance(value_at(message.value, array), Sequence)
    except NoSuchField:
        return False


def _lost(before: Message, after: Message) -> int:
    """How many messages the writer's numbers miss between two."""
    if not 0 < before.sequence < after.sequence < _SEQUENCE_LIMIT:
        return 0
    return after.sequence - before.sequence - 1
