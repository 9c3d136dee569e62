"""Numbers in lines of output, however a program formats them, and the messages that they show."""

from __future__ import annotations

import math
import re
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from grader.findings.condition import difference
from grader.findings.value import number_at
from grader.findings.words import code
from grader.recording.model import NS, LogLine, Message, Recording
from grader.spec.expression import Expression
from grader.spec.text_numbers import MINUS, NUMBER, numbers_in

UNFILLED = re.compile(r"\{[A-Za-z_][^{}\s\"',]*\}|%[-+0-9.]*l{0,2}[dfgsuz]\b")
"""``{position.x:.2f}`` or ``%.2f`` as it stands in the source, where a value should be."""
# `x = 1.37`, `y: -0.62`, `"x": 1.37`: a name and its number with nothing but such signs between.
_NAMED = re.compile(
    r"""(?<![A-Za-z0-9_])(?P<name>[A-Za-z_]\w*)["']?[ \t]*[:=][ \t]*(?P<number>"""
    + NUMBER.pattern
    + ")",
    re.IGNORECASE,
)
# What rclpy's loggers put before a text: `[INFO] [1700000000.123456789] [bot]: `.
_LOG_PREFIX = re.compile(r"\s*\[[A-Z]+\] \[[0-9.]+\] \[[^\]]*\]: ?")
# A float32 and its decimal text differ by less.
_FLOAT_NOISE = 1e-6
_LONGEST_QUOTE = 80


def logged_text(line: str) -> str:
    """A line without what a ROS logger puts before it."""
    return _LOG_PREFIX.sub("", line, count=1)


def quote(line: str) -> str:
    """A line for a finding: without its prefix, marked as code, shortened."""
    text = logged_text(line).strip()
    return code(text if len(text) <= _LONGEST_QUOTE else f"{text[:_LONGEST_QUOTE]}...")


def numbers(line: str) -> tuple[float, ...]:
    """Every number that a line may be read to show, but for those of a logger's prefix."""
    return numbers_in(logged_text(line))


def exchanged(text: str, values: Mapping[str, float], decimals: int) -> tuple[str, str] | None:
    """Two fields each of whose names stands before the other one's value, as in `x = <y>, y = <x>`.

    Names may also follow their numbers or stand apart from them, and such a text is not read.
    """
    named: dict[str, list[float]] = {}
    for match in _NAMED.finditer(logged_text(text).replace(MINUS, "-")):
        named.setdefault(match["name"].lower(), []).append(float(match["number"]))

    def is_named(path: str, value: float) -> bool:
        return any(shows(number, value, decimals) for number in named.get(_last_name(path), []))

    for one, other in combinations(values, 2):
        if _last_name(one) == _last_name(other):
            continue
        is_right = is_named(one, values[one]) or is_named(other, values[other])
        is_exchanged = is_named(one, values[other]) and is_named(other, values[one])
        if is_exchanged and not is_right:
            return one, other
    return None


def _last_name(path: str) -> str:
    """What a line calls a field: ``x`` of ``pose.x``, ``yaw`` of ``yaw(pose.orientation)``."""
    return path.partition("(")[0].rpartition(".")[2].lower()


def shows(number: float, value: float, decimals: int, circle: float = 0.0) -> bool:
    """Whether a printed number stands for a value.

    Args:
        decimals: How many of its decimals must be right; the last of them may be one off,
            because cutting off is right too.
        circle: Of an angle a full turn in its unit.
    """
    if not (math.isfinite(number) and math.isfinite(value)):
        return number == value or (math.isnan(number) and math.isnan(value))
    return abs(difference(value, number, circle)) <= 10.0**-decimals + _FLOAT_NOISE


@dataclass(frozen=True)
class Wanted:
    """What the log should show of one message.

    Attributes:
        ready_ns: When a subscription was there to get it, perhaps after it was published.
        sooner_ns: How long before the message a line may come.
    """

    message: Message
    values: dict[str, float]
    ready_ns: int = 0
    sooner_ns: int = 0

    @property
    def begin_ns(self) -> int:
        """From when on a line counts."""
        return self.message.stamp_ns - self.sooner_ns

    @property
    def due_ns(self) -> int:
        """From when on a line is expected."""
        return max(self.message.stamp_ns, self.ready_ns)


@dataclass(frozen=True)
class Echo:
    """Lines that show all values of one message together; at least one line."""

    wanted: Wanted
    lines: tuple[LogLine, ...]


def wanted_values(
    messages: Sequence[Message], fields: Sequence[str], ready_ns: int = 0, sooner_ns: int = 0
) -> tuple[Wanted, ...]:
    """What the log should show of each message; raises NoSuchField where a number is not there."""
    return tuple(
        Wanted(
            message, {path: number_at(message.value, path) for path in fields}, ready_ns, sooner_ns
        )
        for message in messages
    )


def output_lines(recording: Recording) -> tuple[LogLine, ...]:
    """What the student's processes wrote, oldest first.

    Messages on /rosout are left out: a logger writes each of them to stderr as well, and one
    line must not count twice.
    """
    lines = (line for line in recording.log if line.stream != "rosout")
    return tuple(sorted(lines, key=lambda line: line.time_ns))


def echoes(
    recording: Recording,
    wanted: Sequence[Wanted],
    decimals: int,
    within_ns: int,
    *,
    forgive: bool = False,
) -> tuple[Echo, ...]:
    """Messages that are followed by lines which show their values.

    A line serves one message, so that a single line does not stand for many messages with the
    same values; unless it lists the values of several, as print(..., end=" ") writes them. Lines
    need not come in the order of the messages: with several threads they do not.

    Args:
        within_ns: How soon after its message a line must have come.
    """
    output = _Output(output_lines(recording), decimals)
    found: list[Echo] = []
    number = 0
    while number < len(wanted):
        first = wanted[number]
        end_ns = first.due_ns + within_ns
        if forgive:
            end_ns = recording.own_end_ns(first.begin_ns, (end_ns - first.begin_ns) / NS)
        serving = output.serving(first, end_ns)
        if not serving:
            number += 1
            continue
        values, written_ns = output.numbers[serving[-1]], output.times_ns[serving[-1]]
        following = wanted[number : number + len(values)]
        published = [item for item in following if item.begin_ns <= written_ns]
        listed = _listed(values, published, decimals)
        lines = output.taken(first, serving)
        found += [Echo(item, lines) for item in published[:listed]]
        number += listed
    return tuple(found)


class _Output:
    """The lines of a run, and which of them serve a message already."""

    def __init__(self, lines: Sequence[LogLine], decimals: int) -> None:
        self.times_ns = [line.time_ns for line in lines]
        self.numbers = [numbers(line.text) for line in lines]
        self._lines = tuple(lines)
        self._decimals = decimals
        self._used: set[int] = set()
        self._free = 0

    def serving(self, wanted: Wanted, end_ns: int) -> list[int]:
        """Indices of the next free lines that show all values of a message, or none."""
        missing = set(wanted.values)
        serving: list[int] = []
        begin = bisect_left(self.times_ns, wanted.begin_ns)
        for index in range(begin, bisect_right(self.times_ns, end_ns)):
            if index in self._used:
                continue
            here = missing & shown(self.numbers[index], wanted, self._decimals)
            if not here:
                continue
            missing -= here
            serving.append(index)
            if missing:
                continue
            text = "\n".join(logged_text(self._lines[line].text) for line in serving)
            if not exchanged(text, wanted.values, self._decimals):
                return serving
            missing, serving = set(wanted.values), []
        return []

    def taken(self, wanted: Wanted, serving: Sequence[int]) -> tuple[LogLine, ...]:
        """Take lines for a message, with those before them that belong to it, such as a title."""
        self._used.update(serving)
        first, end = serving[0], serving[-1] + 1
        # Only of lines that come after all others is it known that nothing else stands before.
        if first >= self._free:
            first = max(bisect_left(self.times_ns, wanted.begin_ns), self._free)
        self._free = max(self._free, end)
        return self._lines[first:end]


def _listed(printed: Sequence[float], wanted: Sequence[Wanted], decimals: int) -> int:
    """How many messages a line serves: its numbers are their values in order, no two the same."""
    values = [value for item in wanted for value in item.values.values()][: len(printed)]
    single = all(len(item.values) == 1 for item in wanted)
    if not single or len(values) < len(printed) or len(set(printed)) < len(printed):
        return 1
    right = all(shows(*pair, decimals) for pair in zip(printed, values, strict=True))
    return len(printed) if right else 1


def shown(printed: Sequence[float], wanted: Wanted, decimals: int) -> set[str]:
    """Fields whose values are among the numbers of a line."""
    return {
        path
        for path, value in wanted.values.items()
        if any(shows(number, value, decimals, Expression.of(path).circle) for number in printed)
    }
