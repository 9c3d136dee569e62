"""What the process declared of its executor and its callback groups: supporting evidence."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from grader.findings.finding import Finding
from grader.findings.words import code, codes, listing
from grader.findings.words import group_class, worded
from grader.measure.callback_runs import Run, timed
from grader.measure.declarations import executors
from grader.recording.model import Recording

_EXCLUSIVE = "MutuallyExclusiveCallbackGroup"
# The clock of a report and that of the tracer may differ by so much.
_SLACK_NS = 1_000_000


def threads(recording: Recording) -> int:
    """Threads of the largest executor that was spun; 0 if none was declared."""
    return max((number for _, number in executors(recording)), default=0)


def executor_with(threads: int) -> str:
    """The code that makes an executor with some threads."""
    return worded(
        python=f"MultiThreadedExecutor(num_threads={threads})",
        cpp="rclcpp::executors::MultiThreadedExecutor executor(rclcpp::ExecutorOptions(), "
        f"{threads})",
    )


def declared_words(recording: Recording) -> str:
    """The executor and the callback groups in words, or an empty text."""
    named = [
        f"a {code(name)}" + (f" with {number} threads" if number > 1 else "")
        for name, number in executors(recording)
    ]
    words = [listing(named)] if named else []
    groups = _groups(recording, "timer")
    if len(groups) > 1:
        words.append(f"its timers in {_group_words(groups)}")
    groups = _groups(recording, "subscription")
    if groups:
        words.append(f"its subscription in {_group_words(groups)}")
    return f"the process declared {', '.join(words)}" if words else ""


def single(recording: Recording) -> bool:
    """Whether only executors with one thread were spun."""
    found = executors(recording)
    return bool(found) and all(number == 1 for _, number in found)


def forbids(recording: Recording, *, itself: bool) -> bool:
    """Whether the declared callback groups or executor keep these callbacks apart."""
    groups = _groups(recording, "subscription")
    return single(recording) or (itself and len(groups) == 1 and groups[0][0] == _EXCLUSIVE)


def not_judged(
    recording: Recording, observed: str, *, prevented: bool, at_once: int = 2
) -> Finding | None:
    """The finding where it is not the student's fault that callbacks did not run together."""
    if prevented and not _lacks_threads(recording, at_once):
        return Finding.undecided(f"{observed}, but the machine took the time from the process")
    return None


def kept_apart(recording: Recording, runs: Iterable[Run]) -> bool:
    """Whether one mutually exclusive group made all of these runs, as the tracer timed it."""
    calls, groups = timed(recording), set[str]()
    for run in runs:
        around = {
            call.group
            for call in calls
            if call.begin_ns - _SLACK_NS <= run.begin_ns
            and (run.end_ns or 0) <= (call.end_ns or 0) + _SLACK_NS
        }
        groups |= around if len(around) == 1 else {""}
    return len(groups) == 1 and groups.pop().startswith(_EXCLUSIVE)


def _lacks_threads(recording: Recording, at_once: int) -> bool:
    """Whether all that was spun is one executor of fewer threads: that kept them apart."""
    return len(recording.declared("spin")) == 1 and 0 < threads(recording) < at_once


def allows(recording: Recording) -> bool:
    """Whether the process declared what lets its timers run at the same time."""
    return (
        threads(recording) > 1
        and len(_groups(recording, "timer")) > 1
        and not shares_exclusive_group(recording)
    )


def shares_exclusive_group(recording: Recording) -> bool:
    """Whether the timers are all in one mutually exclusive group."""
    groups = _groups(recording, "timer")
    return (
        len(groups) > 1 and {kind for kind, _ in groups} == {_EXCLUSIVE} and len(set(groups)) == 1
    )


def _groups(recording: Recording, kind: str) -> list[tuple[str, Any]]:
    found = []
    for item in recording.declared(kind):
        group = item.data.get("group")
        if isinstance(group, Mapping) and isinstance(group.get("type"), str):
            found.append((str(group["type"]), str(group.get("id"))))
    return found or _groups_of_runs(recording, kind)


def _groups_of_runs(recording: Recording, kind: str) -> list[tuple[str, Any]]:
    """Those of a program in C++, of which only the calls tell; as many as there are timers."""
    is_timer = kind == "timer"
    runs = [run for run in timed(recording) if run.serves.startswith("/") is not is_timer]
    parts = [group.partition(" ") for group in dict.fromkeys(run.group for run in runs)]
    found: list[tuple[str, Any]] = [(type_, id_) for type_, _, id_ in parts if id_]
    more = len(recording.declared(kind)) - len(found) if is_timer else 0
    return found + found[-1:] * more


def _group_words(groups: list[tuple[str, Any]]) -> str:
    kinds = [group_class(kind) for kind, _ in dict.fromkeys(groups)]
    if len(kinds) == 1:
        return f"one {code(kinds[0])}"
    return codes(kinds) if len(set(kinds)) > 1 else f"{len(kinds)} {code(kinds[0] + 's')}"
