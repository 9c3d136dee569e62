"""The check of whether callbacks run at the same time, or never do."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise

from pydantic import Field

from grader.checks.check import Parameters, Subject, check
from grader.checks.log.log_content import logged, printed
from grader.diagnosis.cause import Cause
from grader.diagnosis.process.blocked_executor import why_not_called
from grader.diagnosis.process.process_exit import why_ended
from grader.findings.finding import Evidence, Finding, Moment
from grader.findings.wording import code, codes, counted, listing
from grader.measure.callback_runs import Event, Run, overlaps, paired, spans
from grader.measure.declarations import was_held_up
from grader.recording.model import NS, Recording

_HINT = (
    "rclpy.spin(node) and a SingleThreadedExecutor run one callback at a time. When a "
    "MultiThreadedExecutor spins, only callbacks of one MutuallyExclusiveCallbackGroup wait for "
    "each other; without callback_group=... all are in one, the node's default group."
)


class Overlap(Parameters):
    """Parameters of executor.overlap."""

    callbacks: tuple[str, ...] = Field(
        min_length=1, description="Words for each callback in lines of the log, such as `timer_1`."
    )
    never: bool = Field(False, description="Whether no two runs of them may overlap.")
    at_least: int = Field(2, ge=1, description="How often each must overlap; with `never`, run.")
    log: tuple[str, str] = Field(
        description="Words in the lines that a callback logs or prints when it starts and ends."
    )

    def runs(self, recording: Recording) -> list[Run]:
        """The complete runs of the callbacks."""
        return [run for run in paired(self._logged(recording, *self.log))[0] if run.end_ns]

    def _logged(self, recording: Recording, start: str, end: str) -> Iterator[Event]:
        lines = [(one.time_ns, one.text) for one in logged(recording)]
        lines += [(one.time_ns, one.text) for one in printed(recording)]
        for time_ns, text in sorted(lines, key=lambda line: line[0]):
            for callback in self.callbacks:
                if _says(text, callback) and _says(text, start) != _says(text, end):
                    yield callback, _says(text, start), time_ns


def _says(text: str, words: str) -> bool:
    return re.search(rf"(?<!\w){re.escape(words)}(?!\w)", text, re.IGNORECASE) is not None


@check("executor.overlap", Subject.RECORDING, Overlap)
def overlap(recording: Recording, parameters: Overlap) -> Finding:
    """Callbacks run at the same time, or never do.

    Each of the named callbacks must overlap with another of them, a single one with itself. With
    `never`, no two of their runs may overlap.
    """
    names, never, least = parameters.callbacks, parameters.never, parameters.at_least
    expected = f"{codes(names)} {'never ' * never}running at the same time"
    expected += f", in {counted(least, 'run')} of each" if never else f", {least} times or more"
    runs = parameters.runs(recording)
    missing = _why_missing(recording, names, runs, least if never else 1)
    if missing is not None:
        return missing.finding(expected)
    found = [(both.one, both.other) for both in overlaps(runs)]
    if not never and len(names) > 1:
        found = [(one, other) for one, other in found if one.callback != other.callback]
    numbers = {name: sum(name in (a.callback, b.callback) for a, b in found) for name in names}
    parts = [f"{code(name)} overlaps {counted(numbers[name], 'time')}" for name in names]
    observed = f"{counted(len(runs), 'run')}: {listing(parts)}"
    wrong = [run for both in found for run in both] if never else []
    moment = Moment("one runs", recording.since_launch_s((wrong or runs)[0].begin_ns))
    evidence = Evidence((moment,), spans=spans(recording, runs, wrong))
    if not found if never else min(numbers.values()) >= least:
        return Finding.passed(expected, observed, evidence)
    prevented = sum(_was_held_up(recording, one, other) for one, other in pairwise(runs))
    if not never and min(numbers.values()) + prevented >= least:
        return Finding.to_repeat(expected, f"{observed}, but the machine held callbacks up")
    return Finding.failed(expected, observed, _HINT, evidence)


def _was_held_up(recording: Recording, one: Run, other: Run) -> bool:
    """Whether the machine may have kept a run from overlapping one before by half its duration."""
    half_s = min(one.seconds or 0.0, other.seconds or 0.0) / 2
    lacking_s = (other.begin_ns - (one.end_ns or 0)) / NS + half_s
    return recording.stolen_s(one.begin_ns, other.begin_ns) > lacking_s > 0.0


def _why_missing(
    recording: Recording, names: Sequence[str], runs: Sequence[Run], least: int
) -> Cause | None:
    """Why a callback has not run as often as it must to be judged, or None if each has."""
    number, name = min((sum(run.callback == name for run in runs), name) for name in names)
    if number >= least:
        return None
    seen = f"{code(name)} ran {counted(number, 'time')}, of {least} that are needed"
    cause = why_ended(recording, seen) or why_not_called(recording, seen, ())
    return cause or Cause(
        seen,
        "Is it created in the constructor, and does it log the words when it starts and ends?",
        Evidence((Moment("launched", 0.0),), spans=spans(recording, runs)),
        disturbed=was_held_up(recording),
    )
