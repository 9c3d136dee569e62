"""Runs of callbacks, as the node reports them: ``<callback> start`` and ``<callback> end``."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from grader.findings.finding import Span
from grader.recording.model import NS, Message, Recording

_REPORT = re.compile(r"\s*(\S(?:.*\S)?)\s+(start|end)\s*")
# Clocks of one machine may step by so much; what overlaps overlaps for much longer.
_SLACK_NS = 1_000_000
_MOST_SPANS = 400


@dataclass(frozen=True)
class Run:
    """One call of a callback.

    Attributes:
        end_ns: Source timestamp of its end; None if none was reported.
    """

    callback: str
    begin_ns: int
    end_ns: int | None

    @property
    def seconds(self) -> float | None:
        """How long it lasted."""
        return None if self.end_ns is None else (self.end_ns - self.begin_ns) / NS


@dataclass(frozen=True)
class Reports:
    """The reports of callbacks on a topic."""

    runs: tuple[Run, ...]
    strange: tuple[str, ...]
    orphans: tuple[str, ...]

    @property
    def callbacks(self) -> tuple[str, ...]:
        """Names that were reported, in the order of their first report."""
        return tuple(dict.fromkeys([*(run.callback for run in self.runs), *self.orphans]))

    def of(self, callback: str) -> tuple[Run, ...]:
        """Runs of one callback."""
        return tuple(run for run in self.runs if run.callback == callback)

    def ended(self, callbacks: Iterable[str]) -> tuple[Run, ...]:
        """Runs of some callbacks whose end was reported."""
        names = set(callbacks)
        return tuple(run for run in self.runs if run.callback in names and run.end_ns is not None)


def read_reports(messages: Sequence[Message]) -> Reports:
    """Put starts and ends together.

    Calls of one callback that overlap each other take equally long, so the first that began is
    the first that ends.
    """
    began: dict[str, list[int]] = {}
    runs: list[Run] = []
    strange: list[str] = []
    orphans: list[str] = []
    for message in messages:
        text = message.value.get("data")
        found = _REPORT.fullmatch(text) if isinstance(text, str) else None
        if found is None:
            strange.append(str(text))
            continue
        callback, what = found.groups()
        waiting = began.setdefault(callback, [])
        if what == "start":
            waiting.append(message.stamp_ns)
        elif waiting:
            runs.append(Run(callback, waiting.pop(0), message.stamp_ns))
        else:
            orphans.append(callback)
    runs += [Run(callback, begin_ns, None) for callback, all_ in began.items() for begin_ns in all_]
    return Reports(
        tuple(sorted(runs, key=lambda run: run.begin_ns)), tuple(strange), tuple(orphans)
    )


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
    for run in sorted(runs, key=lambda item: item.begin_ns):
        active = [item for item in active if (item.end_ns or 0) > run.begin_ns]
        for item in active:
            both_ns = min(item.end_ns or 0, run.end_ns or 0) - run.begin_ns
            if both_ns > _SLACK_NS and both_ns >= least_s * NS:
                yield Overlap(item, run, both_ns / NS)
        active.append(run)


def spans(recording: Recording, reports: Reports, wrong: Iterable[Run] = ()) -> tuple[Span, ...]:
    """Runs as bars to draw; a run without an end lasts until the end of the observation."""
    marked = set(wrong)
    return tuple(
        Span(
            run.callback,
            recording.since_launch_s(run.begin_ns),
            recording.since_launch_s(
                run.end_ns if run.end_ns is not None else max(recording.stop_ns, run.begin_ns)
            ),
            wrong=run in marked,
        )
        for run in reports.runs[:_MOST_SPANS]
    )
