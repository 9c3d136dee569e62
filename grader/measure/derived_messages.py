"""Messages whose values come from another topic, each with the sources that it may be made of."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise

from grader.findings.condition import difference
from grader.findings.value import NoSuchItem, Tolerance, number_at, tolerance_of
from grader.measure.numbering import lost
from grader.recording.model import NS, Message, Recording
from grader.spec.expression import Expression

Row = tuple[float, ...]
"""A number for each field."""


@dataclass(frozen=True)
class Sample:
    """A message with the sources that it may be made of.

    Attributes:
        number: Which message on its topic, from 1.
        values: The numbers in its fields; NaN for an item that its array does not have.
        window: Indices of those sources; the last one is the newest that there was.
        errors: How far the values are off, a row for each source with a number for each field.
        excused: How many of the sources, the oldest, are right only by what the host took.
        is_known: Whether the recording has all of those sources. It may lack one that was lost
            on its way, and what was published after the newest one that it has.
    """

    number: int
    message: Message
    values: Row
    window: range
    errors: tuple[Row, ...]
    excused: int
    is_known: bool


@dataclass(frozen=True)
class DerivedMessages:
    """All messages of a topic against those of another one.

    Attributes:
        sources: The messages that they come from, oldest first; at least one.
        table: The right numbers, a row for each source with a number for each field.
    """

    fields: tuple[str, ...]
    values: tuple[str, ...]
    tolerances: Row
    sources: tuple[Message, ...]
    table: tuple[Row, ...]

    @classmethod
    def of(
        cls, sources: tuple[Message, ...], fields: Mapping[str, str], tolerance: Tolerance
    ) -> DerivedMessages:
        """Read the sources; raises NoSuchField where a field is not there, or holds no number."""
        values = tuple(fields.values())
        tolerances = tuple(tolerance_of(tolerance, field) for field in fields)
        table = tuple(tuple(number_at(item.value, one) for one in values) for item in sources)
        return cls(tuple(fields), values, tolerances, sources, table)

    def samples(
        self, recording: Recording, messages: Sequence[Message], within_s: float
    ) -> list[Sample]:
        """Look up which sources each message may be made of.

        Args:
            recording: The run; what the host took from the node makes older sources right.
        """
        stamps = [item.stamp_ns for item in self.sources]
        lost_before = [0, *accumulate(lost(a, b) for a, b in pairwise(self.sources))]
        samples = []
        for number, message in enumerate(messages, start=1):
            values = tuple(_number(message, field) for field in self.fields)
            last = bisect_right(stamps, message.stamp_ns)
            if not last:
                continue
            due_ns = message.stamp_ns - round(within_s * NS)
            begin_ns = recording.own_begin_ns(message.stamp_ns, within_s)
            # Where the source is silent its newest values stay the right ones.
            first = min(bisect_left(stamps, begin_ns), last - 1)
            due = min(bisect_left(stamps, due_ns), last - 1)
            is_known = last < len(stamps) and lost_before[first] == lost_before[last]
            window = range(first, last)
            errors = self.errors(values, window)
            samples.append(Sample(number, message, values, window, errors, due - first, is_known))
        return samples

    def errors(self, values: Row, window: range) -> tuple[Row, ...]:
        """How far values are off from those of some sources."""
        circles = [Expression.of(value).circle for value in self.values]
        return tuple(
            tuple(map(difference, right, values, circles))
            for right in self.table[window.start : window.stop]
        )

    def fitting(self, errors: Sequence[Row], field: int | None = None) -> list[int]:
        """The rows of errors in which one field, or every field, is within the tolerance.

        NaN never is.
        """
        fields = slice(None) if field is None else slice(field, field + 1)
        return [
            index
            for index, row in enumerate(errors)
            if all(
                abs(off) <= most
                for off, most in zip(row[fields], self.tolerances[fields], strict=True)
            )
        ]


def _number(message: Message, field: str) -> float:
    try:
        return number_at(message.value, field)
    except NoSuchItem:
        return math.nan
