"""The check of callbacks that report when they start and end: all of them at the same time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import reduce

from pydantic import Field

from grader.checks.check import Subject, check, stop_if
from grader.findings.finding import Evidence, Finding, Moment
from grader.findings.words import code, codes, counted
from grader.measure.callback_runs import Run
from grader.recording.model import NS, Recording
from grader.spec.quantity import Duration
from grader.spec.unit import format_duration

from . import concurrency
from .callback_run import Reports, read_reports, spans
from .missing_reports import Reported, why_reports_are_missing

# From and until when, in nanoseconds.
_Stretch = tuple[int, int]


class Together(Reported):
    """Parameters of callbacks.together."""

    at_least: int = Field(1, ge=1, description="How often.")
    by: Duration = Field(
        0.1,
        description="Least time that all of them must overlap.",
        validate_default=False,
    )

    def _asked(self) -> str:
        times = counted(self.at_least, "time")
        return (
            f"{codes(self.callbacks)} all running at the same time, {times} or more for "
            f"{format_duration(self.by)}"
        )


@check("callbacks.together", Subject.RECORDING, Together, concept="executors")
def together(recording: Recording, parameters: Together) -> Finding:
    """All callbacks run at the same time.

    All of the callbacks overlap at least `at_least` times, for `by` or longer. Judged by their
    reports on the wire; the executor that the process declared only helps to explain.
    """
    names = parameters.callbacks
    reports = read_reports(recording.on(parameters.topic))
    stop_if(why_reports_are_missing(recording, parameters.topic, names, reports))
    found = [item for item in _all_at_once(reports, names) if _seconds(item) >= parameters.by]
    if len(found) >= parameters.at_least:
        return Finding.as_asked(
            f"they did so {counted(len(found), 'time')}",
            Evidence(
                moments=(Moment("all of them run", recording.since_launch_s(found[0][0])),),
                spans=spans(recording, reports),
            ),
        )
    seen = f"only {counted(len(found), 'time')}" if found else "never"
    observed = f"{codes(names)} {seen} ran all at the same time"
    most = len(found) + _prevented(recording, reports, parameters)
    prevented = most >= parameters.at_least
    stop_if(
        concurrency.not_judged(recording, observed, prevented=prevented, at_once=len(names))
    )
    declared = concurrency.declared_words(recording)
    return Finding(
        observed + (f"; {declared}" if declared else ""),
        f"{len(names)} callbacks can run at once only if the executor has {len(names)} threads or "
        f"more, {code(concurrency.executor_with(len(names) + 1))}, and if no group, "
        "lock or callback that waits keeps them apart.",
        Evidence(
            moments=(Moment("first run", recording.since_launch_s(reports.runs[0].begin_ns)),),
            spans=spans(recording, reports),
        ),
    )


def _all_at_once(reports: Reports, names: Sequence[str]) -> list[_Stretch]:
    """When a run of each of the callbacks lasted, in order."""
    return reduce(_both, (_busy(reports.ended([name])) for name in names))


def _prevented(recording: Recording, reports: Reports, parameters: Together) -> int:
    """How often more they could have run at the same time had the host taken nothing, at most."""
    number = 0
    runs = {name: reports.ended([name]) for name in parameters.callbacks}
    for last in reports.ended(parameters.callbacks):
        # The newest run of each when this one, perhaps delayed, began.
        before = [
            next((run for run in reversed(items) if run.begin_ns <= last.begin_ns), None)
            for items in runs.values()
        ]
        group = [run for run in before if run is not None]
        both_s = (min(run.end_ns or 0 for run in group) - last.begin_ns) / NS
        stolen_s = recording.stolen_s(min(run.begin_ns for run in group), last.begin_ns)
        if len(group) == len(before) and 0.0 < parameters.by - both_s <= stolen_s:
            number += 1
    return number


def _busy(runs: Iterable[Run]) -> list[_Stretch]:
    """When any of the runs lasted: runs that overlap are one stretch."""
    found: list[_Stretch] = []
    for run in runs:
        end_ns = run.end_ns or run.begin_ns
        if found and run.begin_ns < found[-1][1]:
            found[-1] = (found[-1][0], max(found[-1][1], end_ns))
        else:
            found.append((run.begin_ns, end_ns))
    return found


def _both(one: list[_Stretch], other: list[_Stretch]) -> list[_Stretch]:
    """What two lists of stretches, each in order and apart, have in common."""
    found: list[_Stretch] = []
    first = second = 0
    while first < len(one) and second < len(other):
        begin_ns = max(one[first][0], other[second][0])
        end_ns = min(one[first][1], other[second][1])
        if begin_ns < end_ns:
            found.append((begin_ns, end_ns))
        if one[first][1] <= other[second][1]:
            first += 1
        else:
            second += 1
    return found


def _seconds(stretch: _Stretch) -> float:
    return (stretch[1] - stretch[0]) / NS
