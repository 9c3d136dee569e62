"""Runs of callbacks: when each began and ended, as reported, logged or timed by the tracer."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice

from grader.findings.finding import Span
from grader.recording.model import NS, Recording

Event = tuple[str, bool, int]
"""A callback, whether it is its start, and when."""

# Clocks of one machine may step by so much: runs overlap only if they still do when moved by it.
_SLACK_NS = 1_000_000
_MOST_SPANS = 400


@dataclass(frozen=True)
class Run:
    """One call of a callback; only those that the tracer timed have what follows `end_ns`.

    Attributes:
        end_ns: When it ended; None if no end was reported.
        serves: Name of the topic or the service; of a timer its period, such as ``0.5 s``.
        group: Type and identity of its callback group.
    """

    callback: str
    begin_ns: int
    end_ns: int | None
    serves: str = ""
    group: str = ""
    pid: str = ""
    thread: str = ""

    @property
    def seconds(self) -> float | None:
        """How long it lasted."""
        return None if self.end_ns is None else (self.end_ns - self.begin_ns) / NS


def paired(events: Iterable[Event]) -> tuple[list[Run], list[str]]:
    """Put starts and ends together.

    Calls of one callback that overlap each other take equally long, so the first that began is
    the first that ends.

    Returns:
        The runs in the order of their beginning, and the callbacks of ends without a start.
    """
    began: dict[str, list[int]] = {}
    runs: list[Run] = []
    orphans: list[str] = []
    for callback, is_start, time_ns in events:
        waiting = began.setdefault(callback, [])
        if is_start:
            waiting.append(time_ns)
        elif waiting:
            runs.append(Run(callback, waiting.pop(0), time_ns))
        else:
            orphans.append(callback)
    runs += [Run(callback, begin_ns, None) for callback, all_ in began.items() for begin_ns in all_]
    return sorted(runs, key=lambda run: run.begin_ns), orphans


def timed(recording: Recording) -> list[Run]:
    """The runs that the tracer timed; a process could have written anything."""
    found = []
    for item in recording.declared("ran"):
        keys = ("callback", "serves", "group", "pid", "thread")
        texts = {key: str(item.data.get(key)) for key in keys}
        begin_ns, end_ns = item.data.get("began_ns"), item.data.get("ended_ns")
        if isinstance(begin_ns, int) and isinstance(end_ns, int) and begin_ns <= end_ns:
            found.append(Run(begin_ns=begin_ns, end_ns=end_ns, **texts))
    return sorted(found, key=lambda run: run.begin_ns)


def publishes(recording: Recording, topic: str) -> bool:
    """Whether most of the timed runs of one callback published on a topic.

    Of short runs the process declares only some.
    """
    stamps_ns = sorted(message.stamp_ns for message in recording.on(topic))
    published: dict[tuple[str, str], list[bool]] = {}
    for run in timed(recording):
        if run.end_ns is not None and run.end_ns < recording.stop_ns:
            first, end = bisect_left(stamps_ns, run.begin_ns), bisect_right(stamps_ns, run.end_ns)
            published.setdefault((run.callback, run.serves), []).append(end > first)
    return any(2 * sum(in_each) > len(in_each) for in_each in published.values())


@dataclass(frozen=True)
class Overlap:
    """Two runs at the same time."""

    one: Run
    other: Run
    seconds: float


def overlaps(runs: Iterable[Run], least_s: float = 0.0) -> Iterator[Overlap]:
    """Pairs of runs that overlap, in the order of their beginning.

    Args:
        least_s: How long they must overlap; beyond what clocks may be off.
    """
    active: list[Run] = []
    for later in sorted(runs, key=lambda run: run.begin_ns):
        active = [run for run in active if (run.end_ns or 0) > later.begin_ns]
        for earlier in active:
            earlier_end_ns, later_end_ns = earlier.end_ns or 0, later.end_ns or 0
            both_ns = min(earlier_end_ns, later_end_ns) - later.begin_ns
            # By so much the later run may be moved before they no longer overlap.
            certain_ns = min(earlier_end_ns - later.begin_ns, later_end_ns - earlier.begin_ns)
            if certain_ns > _SLACK_NS and both_ns >= least_s * NS:
                yield Overlap(earlier, later, both_ns / NS)
        active.append(later)


def spans(recording: Recording, runs: Iterable[Run], wrong: Iterable[Run] = ()) -> tuple[Span, ...]:
    """Runs as bars to draw; a run without an end lasts until the end of the observation."""
    marked = set(wrong)
    bars = []
    for run in islice(runs, _MOST_SPANS):
        end_ns = max(recording.stop_ns, run.begin_ns) if run.end_ns is None else run.end_ns
        begin_s, end_s = recording.since_launch_s(run.begin_ns), recording.since_launch_s(end_ns)
        bars.append(Span(run.callback, begin_s, end_s, wrong=run in marked))
    return tuple(bars)
