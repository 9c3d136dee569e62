"""A part of a run: the recording as if nothing had been observed outside of a window of time."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from itertools import pairwise
from operator import attrgetter
from typing import TypeVar

from grader.recording.model import NS, Ending, LogLine, Message, Recording

_STAMP = re.compile(r"\[[A-Z]+\] \[(\d{1,12})\.(\d{9})\] \[")
Item = TypeVar("Item")


def cut(recording: Recording, begin_ns: int, end_ns: int) -> Recording:
    """What was observed in ``[begin_ns, end_ns)``.

    The graph, the processes, what they declare (but for the runs of callbacks) and the delays of
    the machine stay whole. Times still count from the launch of the run.
    """

    def inside(items: Iterable[Item], time_ns: Callable[[Item], int]) -> tuple[Item, ...]:
        return tuple(item for item in items if begin_ns <= time_ns(item) < end_ns)

    def streams(found: Mapping[str, tuple[Message, ...]]) -> dict[str, tuple[Message, ...]]:
        stamp = attrgetter("stamp_ns")
        # Static transforms are published once, and hold in every window.
        return {
            name: items if name.endswith("/tf_static") else _renumbered(inside(items, stamp))
            for name, items in found.items()
        }

    return replace(
        recording,
        messages=streams(recording.messages),
        sent=streams(recording.sent),
        log=inside(recording.log, _written_ns),
        declarations=tuple(
            item
            for item in recording.declarations
            if item.kind != "ran" or begin_ns <= item.time_ns < end_ns
        ),
        truth=inside(recording.truth, attrgetter("time_ns")),
        # What was done to a turtle before holds in the window, such as the colour of its pen.
        turtles=tuple(one for one in recording.turtles if one.time_ns < end_ns),
        incidents=inside(recording.incidents, attrgetter("time_ns")),
        calls=inside(recording.calls, attrgetter("requested_ns")),
        goals=inside(recording.goals, attrgetter("sent_ns")),
        asked=inside(recording.asked, attrgetter("asked_ns")),
        matched_ns=None if recording.matched_ns is None else max(recording.matched_ns, begin_ns),
        stop_ns=min(recording.stop_ns, end_ns),
        # What a process did after the window does not matter in it.
        ending=Ending.UNTIL if end_ns <= recording.stop_ns else recording.ending,
    )


def _written_ns(line: LogLine) -> int:
    """When a line was written: a logger's line says it itself, and is read a little later."""
    stamp = _STAMP.match(line.text)
    return int(stamp[1]) * NS + int(stamp[2]) if stamp else line.time_ns


def _renumbered(messages: tuple[Message, ...]) -> tuple[Message, ...]:
    """The same messages, of one writer counted from 1; without numbers where several write."""
    numbers = [message.sequence for message in messages]
    first = numbers[0] if numbers and all(a < b for a, b in pairwise(numbers)) else None
    return tuple(
        replace(one, sequence=0 if first is None else one.sequence - first + 1) for one in messages
    )
