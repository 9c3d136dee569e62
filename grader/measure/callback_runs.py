"""Runs of callbacks: when each began and ended, as reported or logged."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from grader.findings.finding import Span
from grader.recording.model import NS, Recording

Event = tuple[str, bool, int]
"""A callback, whether it is its start, and when."""

# Clocks of one machine may step by so much; what overlaps overlaps for much longer.
_SLACK_NS = 1_000_000
_MOST_SPANS = 400


@dataclass(frozen=True)
class Run:
    """One call of a callback; `end_ns` is None if no end was reported."""

    callback: str
    begin_ns: int
    end_ns: int | None

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


@dataclass(frozen=True)
class Overlap:
    """Two runs at the same time."""

    one: Run
    other: Run
    seconds: float


def overlaps(runs: Iterable[Run], least_s: float = 0.0) -> Iterator[Overlap]:
    """Pairs of runs that overlap by this or longer, in the order of their beginning."""
    active: list[Run] = []
    for run in sorted(runs, key=lambda item: item.begin_ns):
        active = [item for item in active if (item.end_ns or 0) > run.begin_ns]
        for item in active:
            both_ns = min(item.end_ns or 0, run.end_ns or 0) - run.begin_ns
            if both_ns > _SLACK_NS and both_ns >= least_s * NS:
                yield Overlap(item, run, both_ns / NS)
        active.append(run)


def spans(recording: Recording, runs: Iterable[Run], wrong: Iterable[Run] = ()) -> tuple[Span, ...]:
    """Runs as bars to draw; a run without an end lasts until the end of the observation."""
    marked = set(wrong)
    return tuple(
        Span(
            run.callback,
            recording.since_launch_s(run.begin_ns),
            recording.since_launch_s(run.end_ns or max(recording.stop_ns, run.begin_ns)),
            wrong=run in marked,
        )
        for run in tuple(runs)[:_MOST_SPANS]
    )
