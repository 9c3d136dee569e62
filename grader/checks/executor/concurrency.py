"""Checks of how callbacks run: at the same time or never, in which executor and which groups."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Literal

from pydantic import Field

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.checks.log.log_content import logged, printed
from grader.diagnosis.explanation import cause_of, explain, mistaken
from grader.diagnosis.process.not_called import Uncalled
from grader.diagnosis.undeclared import why_undeclared
from grader.diagnosis.wrong_executor import GROUP, MULTI, SINGLE, OtherExecution
from grader.findings.finding import Evidence, Finding, Moment, moment
from grader.findings.words import code, codes, counted, group_class, listing
from grader.measure.callback_runs import Event, Run, overlaps, paired, spans, timed
from grader.measure.declarations import (
    executors,
    hides_calls,
    traced,
    was_held_up,
)
from grader.recording.model import NS, Recording
from grader.spec.unit import Dimension, parse_quantity

_CALLBACKS = (
    "Each is a topic that the node subscribes to or a service that it offers (`/chatter`), the "
    "period of a timer (`500 ms`), or the name of a function or method."
)
# How far a timer's period may be from that by which it is named.
_SAME_PERIOD = 0.05


class Overlap(Parameters):
    """Parameters of executor.overlap."""

    about = ("timer", "subscription")
    callbacks: tuple[str, ...] = Field(
        min_length=1, description=f"{_CALLBACKS} With `log`, the words for it in lines of the log."
    )
    never: bool = Field(False, description="Whether no two runs of them may overlap.")
    at_least: int = Field(2, ge=1, description="How often each must overlap; with `never`, run.")
    log: tuple[str, str] | None = Field(
        None,
        description="Words in the lines that callbacks log or print when they start and end, such "
        "as `[start, end]`; by default rclpy itself declares when it calls them.",
    )

    def _asked(self) -> str:
        callbacks = listing(map(_words, self.callbacks))
        asked = f"{callbacks} {'never ' * self.never}running at the same time"
        runs = f"in {counted(self.at_least, 'run')} of each"
        return f"{asked}, {runs if self.never else f'{self.at_least} times or more'}"

    def runs(self, recording: Recording) -> list[Run]:
        """The complete runs of the callbacks, under the names that they have here."""
        if self.log is None:
            return _named(recording, self.callbacks)
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


def _named(recording: Recording, names: Sequence[str]) -> list[Run]:
    runs = timed(recording)
    return [replace(run, callback=name) for run in runs for name in names if _is(run, name)]


def _words(name: str) -> str:
    """A callback as the assignment names it: what only has a period is a timer."""
    return f"the timer of {code(name)}" if re.match(r"[0-9.]", name) else code(name)


def _is(run: Run, name: str) -> bool:
    try:
        period_s, named_s = (parse_quantity(one, Dimension.TIME) for one in (run.serves, name))
    except ValueError:
        return name in (run.serves, run.callback, run.callback.rpartition(".")[2])
    return abs(period_s - named_s) <= _SAME_PERIOD * named_s


@check("executor.overlap", Subject.RECORDING, Overlap, concept="executors")
def overlap(recording: Recording, parameters: Overlap) -> Finding:
    """Callbacks run at the same time, or never do.

    Each of the named callbacks must overlap with another of them, a single one with itself. With
    `never`, no two of their runs may overlap. Only the first 1,000 runs of a process are declared.
    """
    names, never, least = parameters.callbacks, parameters.never, parameters.at_least
    runs = parameters.runs(recording)
    declared = parameters.log is None
    stop_if(_why_missing(recording, names, runs, least if never else 1, declared=declared))
    found = [(both.one, both.other) for both in overlaps(runs)]
    if not never and len(names) > 1:
        found = [(one, other) for one, other in found if one.callback != other.callback]
    numbers = {name: sum(name in (a.callback, b.callback) for a, b in found) for name in names}
    parts = [f"{_words(name)} overlaps {counted(numbers[name], 'time')}" for name in names]
    observed = f"{counted(len(runs), 'run')}: {listing(parts)}"
    wrong = [run for both in found for run in both] if never else []
    first = moment(recording, "one runs", (wrong or runs)[0].begin_ns)
    evidence = Evidence((first,), spans=spans(recording, runs, wrong))
    if not found if never else min(numbers.values()) >= least:
        return Finding.as_asked(observed, evidence)
    followed = [pair for pair in pairwise(runs) if _half_s(*pair) > _gap_s(*pair) > -_half_s(*pair)]
    prevented = sum(_was_held_up(recording, *pair) for pair in pairwise(runs))
    kept_apart = sum(not _was_held_up(recording, *pair) for pair in followed)
    # Where one waited for the other, and the machine took nothing, they were kept apart.
    if not never and prevented > kept_apart and min(numbers.values()) + prevented >= least:
        return Finding.undecided(f"{observed}, but the machine held callbacks up")
    hint = cause_of(OtherExecution(recording, runs, together=not never))
    return Finding(observed, hint, evidence)


def _was_held_up(recording: Recording, one: Run, other: Run) -> bool:
    """Whether the machine may have kept a run from overlapping one before by half its duration."""
    lacking_s = _gap_s(one, other) + _half_s(one, other)
    return recording.stolen_s(one.begin_ns, other.begin_ns) > lacking_s > 0.0


def _gap_s(one: Run, other: Run) -> float:
    """How long after one run the other began; negative where they overlap."""
    return (other.begin_ns - (one.end_ns or 0)) / NS


def _half_s(one: Run, other: Run) -> float:
    return min(one.seconds or 0.0, other.seconds or 0.0) / 2


def _why_missing(
    recording: Recording, names: Sequence[str], runs: Sequence[Run], least: int, *, declared: bool
) -> Finding | None:
    """Why a callback has not run as often as it must to be judged, or None if each has."""
    numbers = [(sum(run.callback == name for run in runs), name) for name in names]
    number, name = min(numbers, default=(least, ""))
    seen = f"{_words(name)} ran {counted(number, 'time')}, of {least} that are needed"
    return _why_not_seen(recording, seen, declared=declared) if number < least else None


def _why_not_seen(recording: Recording, seen: str, *, declared: bool = True) -> Finding:
    if declared and hides_calls(recording):
        return Finding.ours(f"{seen}: an EventsExecutor does not tell when callbacks run")
    if declared and not traced(recording):
        return why_undeclared(recording, "its executor and callbacks")
    others = sorted({f"{run.callback} ({run.serves})" for run in timed(recording)})
    cause = explain(Uncalled(recording, seen))
    shown = Evidence((Moment("launched", 0.0),), spans=spans(recording, timed(recording)))
    lacking = mistaken("not_run", seen + (f"; {codes(others)} ran" if others else ""), shown)
    return cause or lacking.doubted(was_held_up(recording))


class ExecutorKind(Parameters):
    """Parameters of executor.kind."""

    about = ("node",)
    executor: Literal["SingleThreadedExecutor", "MultiThreadedExecutor"] = Field(
        description="Kind of the executor that spins."
    )
    threads: int = Field(1, ge=1, description="Least number of its threads.")
    callbacks: tuple[str, ...] = Field((), description=_CALLBACKS)
    groups: Literal["same", "different", "reentrant"] = Field(
        "same", description="Whether `callbacks` are in one mutually exclusive group."
    )

    def _asked(self) -> str:
        asked = f"a {self.executor} that spins, with {counted(self.threads, 'thread')} or more"
        groups = f", and {listing(map(_words, self.callbacks))} in groups: {self.groups}"
        return asked + groups * bool(self.callbacks)


@check("executor.kind", Subject.RECORDING, ExecutorKind, concept="executors")
def kind(recording: Recording, parameters: ExecutorKind) -> Finding:
    """The executor is of a kind, and callbacks are in the same group or in different ones.

    Judged by what the process declared: executors that spin, and groups of callbacks that ran. If
    runs overlap that these keep apart, the check ends as an error and costs no points. A
    MultiThreadedExecutor without a given number of threads has four or more.
    """
    names, wanted, least = parameters.callbacks, parameters.executor, parameters.threads
    spun, runs = executors(recording), _named(recording, names)
    missing = _why_missing(recording, names, runs, 1, declared=True)
    if missing is not None or not spun:
        return missing or _why_not_seen(recording, "no executor spun")
    impossible = _impossible(recording)
    if impossible:
        return Finding.ours(f"the declarations contradict each other: {impossible}")
    groups = sorted({run.group for run in runs})
    pairs = sorted({(run.callback, groups.index(run.group)) for run in runs})
    exclusive = [group.startswith(GROUP) for group in groups]
    parts = [f"a {name} with {counted(threads, 'thread')} spins" for name, threads in spun]
    parts += [
        f"{_words(name)} is in {group_class(groups[of].split()[0])} {of + 1}" for name, of in pairs
    ]
    right = [name == wanted and threads >= least for name, threads in spun]
    grouped = {
        "same": len(groups) == 1 and all(exclusive),
        "different": len(pairs) == len(groups),
        "reentrant": not any(exclusive),
    }
    evidence = Evidence((Moment("launched", 0.0),), spans=spans(recording, runs))
    # Before one of several threads spins, another may wait for a service.
    good = any(right) if wanted == MULTI else all(right)
    if good and (not names or grouped[parameters.groups]):
        return Finding.as_asked(listing(parts), evidence)
    together = wanted == MULTI and (not good or parameters.groups != "same")
    hint = cause_of(OtherExecution(recording, runs, together))
    return Finding(listing(parts), hint, evidence)


def _impossible(recording: Recording) -> str:
    """Which runs overlap although the declared executor or their group keeps them apart."""
    for both in overlaps(timed(recording)):
        one, other = both.one, both.other
        spins = [item.data for item in recording.declared("spin")]
        spun = [spin.get("executor") for spin in spins if str(spin.get("pid")) == one.pid]
        in_one = one.group == other.group and one.group.startswith(GROUP)
        alone = spun == [SINGLE] and one.thread != other.thread
        if one.pid == other.pid and (in_one or alone):
            return f"{code(one.callback)} and {code(other.callback)} overlap"
    return ""
