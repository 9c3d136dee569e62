"""Runs of callbacks, as the node reports them: ``<callback> start`` and ``<callback> end``."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from grader.findings.finding import Span
from grader.measure import callback_runs
from grader.measure.callback_runs import Run
from grader.recording.model import Message, Recording

_REPORT = re.compile(r"\s*(\S(?:.*\S)?)\s+(start|end)\s*")


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
    """Put starts and ends together."""
    events: list[callback_runs.Event] = []
    strange: list[str] = []
    for message in messages:
        text = message.value.get("data")
        found = _REPORT.fullmatch(text) if isinstance(text, str) else None
        if found is None:
            strange.append(str(text))
        else:
            events.append((found[1], found[2] == "start", message.stamp_ns))
    runs, orphans = callback_runs.paired(events)
    return Reports(tuple(runs), tuple(strange), tuple(orphans))


def spans(recording: Recording, reports: Reports, wrong: Iterable[Run] = ()) -> tuple[Span, ...]:
    """The reported runs as bars to draw."""
    return callback_runs.spans(recording, reports.runs, wrong)
