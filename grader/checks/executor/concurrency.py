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
from grader.measure.declarations import executors, hides_calls, traced, was_held_up
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
        never = "never " if self.never else ""
        asked = f"{listing(map(_words, self.callbacks))} {never}running at the same time"
        if self.never:
            return f"{asked}, in {counted(self.at_least, 'run')} of each"
        return f"{asked}, {self.at_least} times or more"

    def runs(self, recording: Recording) -> list[Run]:
        """The complete runs of the callbacks, under the names that they have here."""
        if self.log is None:
            return _runs_of(recording, self.callbacks)
        return [run for run in paired(self._logged(recording, *self.log))[0] if run.end_ns]

    def _logged(self, recording: Recording, start: str, end: str) -> Iterator[Event]:
        lines = [(record.time_ns, record.text) for record in logged(recording)]
        lines += [(line.time_ns, line.text) for line in printed(recording)]
        for time_ns, text in sorted(lines, key=lambda line: line[0]):
            is_start, is_end = _has_words(text, start), _has_words(text, end)
            # A line with both words, or with none, tells of neither.
            if is_start != is_end:
                for callback in self.callbacks:
                    if _has_words(text, callback):
                        yield callback, is_start, time_ns


def _has_words(text: str, words: str) -> bool:
    return re.search(rf"(?<!\w){re.escape(words)}(?!\w)", text, re.IGNORECASE) is not None


def _runs_of(recording: Recording, names: Sequence[str]) -> list[Run]:
    """The timed runs of some callbacks, under the names by which the assignment has them."""
    runs = timed(recording)
    return [replace(run, callback=name) for run in runs for name in names if _is_of(run, name)]


def _is_of(run: Run, name: str) -> bool:
    """Whether a run is of the callback that an assignment names by its period or its name."""
    try:
        period_s, named_s = (parse_quantity(text, Dimension.TIME) for text in (run.serves, name))
    except ValueError:
        return name in (run.serves, run.callback, run.callback.rpartition(".")[2])
    return abs(period_s - named_s) <= _SAME_PERIOD * named_s


def _words(name: str) -> str:
    """A callback as the assignment names it: what only has a period is a timer."""
    return f"the timer of {code(name)}" if re.match(r"[0-9.]", name) else code(name)


@check("executor.overlap", Subject.RECORDING, Overlap, concept="executors")
def overlap(recording: Recording, parameters: Overlap) -> Finding:
    """Callbacks run at the same time, or never do.

    Each of the named callbacks must overlap with another of them, a single one with itself. With
    `never`, no two of their runs may overlap. Only the first 1,000 runs of a process are declared.
    """
    names, never, least = parameters.callbacks, parameters.never, parameters.at_least
    runs = parameters.runs(recording)
    needed = least if never else 1
    declared = parameters.log is None
    stop_if(_why_too_few_runs(recording, names, runs, needed, declared=declared))
    pairs = [(both.one, both.other) for both in overlaps(runs)]
    if not never and len(names) > 1:
        pairs = [(one, other) for one, other in pairs if one.callback != other.callback]
    counts = {name: sum(name in (a.callback, b.callback) for a, b in pairs) for name in names}
    parts = [f"{_words(name)} overlaps {counted(count, 'time')}" for name, count in counts.items()]
    observed = f"{counted(len(runs), 'run')}: {listing(parts)}"
    wrong = [run for pair in pairs for run in pair] if never else []
    first = moment(recording, "one runs", (wrong or runs)[0].begin_ns)
    evidence = Evidence((first,), spans=spans(recording, runs, wrong))
    fewest = min(counts.values())
    is_right = not pairs if never else fewest >= least
    if is_right:
        return Finding.as_asked(observed, evidence)
    if not never and _machine_may_explain(recording, runs, lacking=least - fewest):
        return Finding.undecided(f"{observed}, but the machine held callbacks up")
    hint = cause_of(OtherExecution(recording, runs, together=not never))
    return Finding(observed, hint, evidence)


def _machine_may_explain(recording: Recording, runs: Sequence[Run], lacking: int) -> bool:
    """Whether the machine may have prevented all the overlaps that are lacking.

    Not if as many runs or more waited for the one before although the machine took nothing: then
    the executor or a group kept them apart.
    """
    prevented = kept_apart = 0
    for one, other in pairwise(runs):
        if _was_held_up(recording, one, other):
            prevented += 1
        elif abs(_gap_s(one, other)) < _half_s(one, other):
            kept_apart += 1
    return prevented > kept_apart and prevented >= lacking


def _was_held_up(recording: Recording, one: Run, other: Run) -> bool:
    """Whether the machine may have kept a run from overlapping one before by half its duration."""
    lacking_s = _gap_s(one, other) + _half_s(one, other)
    return recording.stolen_s(one.begin_ns, other.begin_ns) > lacking_s > 0.0


def _gap_s(one: Run, other: Run) -> float:
    """How long after one run the other began; negative where they overlap."""
    return (other.begin_ns - (one.end_ns or 0)) / NS


def _half_s(one: Run, other: Run) -> float:
    """Half of the shorter run."""
    return min(one.seconds or 0.0, other.seconds or 0.0) / 2


def _why_too_few_runs(
    recording: Recording, names: Sequence[str], runs: Sequence[Run], needed: int, *, declared: bool
) -> Finding | None:
    """Why a callback has not run as often as it must to be judged, or None if each has."""
    if not names:
        return None
    fewest, name = min((sum(run.callback == name for run in runs), name) for name in names)
    if fewest >= needed:
        return None
    seen = f"{_words(name)} ran {counted(fewest, 'time')}, of {needed} that are needed"
    return _why_not_seen(recording, seen, declared=declared)


def _why_not_seen(recording: Recording, seen: str, *, declared: bool = True) -> Finding:
    if declared and hides_calls(recording):
        return Finding.ours(f"{seen}: an EventsExecutor does not tell when callbacks run")
    if declared and not traced(recording):
        return why_undeclared(recording, "its executor and callbacks")
    cause = explain(Uncalled(recording, seen))
    if cause is not None:
        return cause
    runs = timed(recording)
    others = sorted({f"{run.callback} ({run.serves})" for run in runs})
    if others:
        seen += f"; {codes(others)} ran"
    shown = Evidence((Moment("launched", 0.0),), spans=spans(recording, runs))
    return mistaken("not_run", seen, shown).doubted(was_held_up(recording))


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
        if not self.callbacks:
            return asked
        return f"{asked}, and {listing(map(_words, self.callbacks))} in groups: {self.groups}"


@check("executor.kind", Subject.RECORDING, ExecutorKind, concept="executors")
def kind(recording: Recording, parameters: ExecutorKind) -> Finding:
    """The executor is of a kind, and callbacks are in the same group or in different ones.

    Judged by what the process declared: executors that spin, and groups of callbacks that ran. If
    runs overlap that these keep apart, the check ends as an error and costs no points. A
    MultiThreadedExecutor without a given number of threads has four or more.
    """
    names, spun = parameters.callbacks, executors(recording)
    runs = _runs_of(recording, names)
    stop_if(_why_too_few_runs(recording, names, runs, 1, declared=True))
    if not spun:
        return _why_not_seen(recording, "no executor spun")
    contradiction = _contradiction(recording)
    if contradiction:
        return Finding.ours(f"the declarations contradict each other: {contradiction}")
    groups = sorted({run.group for run in runs})
    members = sorted({(run.callback, groups.index(run.group)) for run in runs})
    parts = [f"a {name} with {counted(threads, 'thread')} spins" for name, threads in spun]
    for name, index in members:
        kind_of_group = group_class(groups[index].split()[0])
        parts.append(f"{_words(name)} is in {kind_of_group} {index + 1}")
    evidence = Evidence((Moment("launched", 0.0),), spans=spans(recording, runs))
    is_multi = parameters.executor == MULTI
    as_asked = [
        name == parameters.executor and threads >= parameters.threads for name, threads in spun
    ]
    # Before one of several threads spins, another may wait for a service.
    right_executor = any(as_asked) if is_multi else all(as_asked)
    if right_executor and (not names or _are_in_groups(parameters.groups, groups, len(members))):
        return Finding.as_asked(listing(parts), evidence)
    together = is_multi and (not right_executor or parameters.groups != "same")
    hint = cause_of(OtherExecution(recording, runs, together))
    return Finding(listing(parts), hint, evidence)


def _are_in_groups(asked: str, groups: Sequence[str], members: int) -> bool:
    """Whether callbacks are grouped as asked; ``members`` counts each with each of its groups."""
    is_exclusive = [group.startswith(GROUP) for group in groups]
    if asked == "same":
        return len(groups) == 1 and is_exclusive[0]
    if asked == "different":
        return members == len(groups)
    return not any(is_exclusive)


def _contradiction(recording: Recording) -> str:
    """Which runs overlap although the declared executor or their group keeps them apart."""
    for both in overlaps(timed(recording)):
        one, other = both.one, both.other
        if one.pid != other.pid:
            continue
        spins = [item.data for item in recording.declared("spin")]
        kinds = [spin.get("executor") for spin in spins if str(spin.get("pid")) == one.pid]
        in_one_group = one.group == other.group and one.group.startswith(GROUP)
        threads_of_one = kinds == [SINGLE] and one.thread != other.thread
        if in_one_group or threads_of_one:
            return f"{code(one.callback)} and {code(other.callback)} overlap"
    return ""
