"""Echoes of messages: lines of output that show the values of a message soon after it."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass

from grader.checks.value import number_at
from grader.measure.printed import exchanged, logged_text, numbers, shows
from grader.recording.model import NS, LogLine, Message, Recording


@dataclass(frozen=True)
class Wanted:
    """What the log should show of one message.

    Attributes:
        ready_ns: When a subscription was there to get it, perhaps after it was published.
    """

    message: Message
    values: dict[str, float]
    ready_ns: int = 0

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
    messages: Sequence[Message], fields: Sequence[str], ready_ns: int = 0
) -> tuple[Wanted, ...]:
    """What the log should show of each message; raises NoSuchField where a number is not there."""
    return tuple(
        Wanted(message, {path: number_at(message.value, path) for path in fields}, ready_ns)
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
        decimals: How many decimals must be right.
        within_ns: How soon after its message a line must have come.
    """
    lines = output_lines(recording)
    times = [line.time_ns for line in lines]
    printed = [numbers(line.text) for line in lines]
    found: list[Echo] = []
    used: set[int] = set()
    free = number = 0
    while number < len(wanted):
        item = wanted[number]
        number += 1
        begin_ns = item.message.stamp_ns
        end_ns = item.due_ns + within_ns
        if forgive:
            end_ns += round(recording.stolen_s(begin_ns, end_ns) * NS)
        missing = set(item.values)
        serving: list[int] = []
        begin = bisect_left(times, begin_ns)
        for index in range(begin, len(lines)):
            if times[index] > end_ns:
                break
            if index in used:
                continue
            here = missing & shown(printed[index], item, decimals)
            if not here:
                continue
            missing -= here
            serving.append(index)
            if missing:
                continue
            texts = "\n".join(logged_text(lines[one].text) for one in serving)
            if exchanged(texts, item.values, decimals):
                missing, serving = set(item.values), []
            else:
                used.update(serving)
                # Lines before it belong to it, such as a title, if they come after all others.
                first = max(begin, free) if serving[0] >= free else serving[0]
                served, free = lines[first : index + 1], max(free, index + 1)
                others = wanted[number : number + len(printed[index]) - 1]
                before = [one for one in others if one.message.stamp_ns <= times[index]]
                listed = _listed(printed[index], [item, *before], decimals)
                found += [Echo(one, served) for one in [item, *before][:listed]]
                number += listed - 1
                break
    return tuple(found)


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
        if any(shows(number, value, decimals) for number in printed)
    }
