"""Checks of callbacks that report when they start and end: whether they run at the same time."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import Field

from grader.checks.check import Subject, check, stop_if
from grader.findings.finding import Evidence, Finding, Moment
from grader.findings.words import code, codes, counted, listing
from grader.findings.words import EXCLUSIVE, REENTRANT, SPIN_NODE, worded
from grader.measure.callback_runs import Overlap, Run, overlaps
from grader.recording.model import NS, Recording
from grader.spec.quantity import Duration
from grader.spec.unit import format_duration

from . import concurrency
from .callback_run import Reports, read_reports, spans
from .missing_reports import Reported, why_reports_are_missing


class NeverOverlap(Reported):
    """Parameters of callbacks.never_overlap."""

    at_least: int = Field(2, ge=1, description="How often each callback must have run.")

    def _asked(self) -> str:
        if len(self.callbacks) > 1:
            return f"no two runs of {codes(self.callbacks, 'or')} at the same time"
        return f"{code(self.callbacks[0])} never running twice at the same time"


@check("callbacks.never_overlap", Subject.RECORDING, NeverOverlap, concept="executors")
def never_overlap(recording: Recording, parameters: NeverOverlap) -> Finding:
    """Callbacks never run at the same time.

    No two runs of the named callbacks may overlap, neither of different ones nor of the same one.
    Judged by their reports on the wire; the executor and the callback groups that the process
    declared only help to explain.
    """
    names = parameters.callbacks
    reports = read_reports(recording.on(parameters.topic))
    least = parameters.at_least
    stop_if(why_reports_are_missing(recording, parameters.topic, names, reports, least))
    runs = reports.ended(names)
    found = list(overlaps(runs))
    if not found:
        return Finding.as_asked(
            f"{counted(len(runs), 'run')}, one after the other",
            Evidence(spans=spans(recording, reports)),
        )
    worst = max(found, key=lambda item: item.seconds)
    return Finding(
        f"{_overlap_words(recording, worst)}, and {counted(len(found), 'overlap')} in all"
        + _declared(recording),
        _exclusion_hint(recording, names, worst),
        Evidence(
            moments=(
                Moment(
                    f"{worst.one.callback} and {worst.other.callback} overlap",
                    recording.since_launch_s(worst.other.begin_ns),
                ),
            ),
            spans=spans(recording, reports, _all(found)),
        ),
    )


def _overlap_words(recording: Recording, overlap: Overlap) -> str:
    when_s = recording.since_launch_s(overlap.other.begin_ns)
    at_once = (
        f"at the same time for {format_duration(overlap.seconds)}, {when_s:.2f} s after launch"
    )
    if overlap.one.callback == overlap.other.callback:
        return f"{code(overlap.one.callback)} ran twice {at_once}"
    return f"{code(overlap.one.callback)} and {code(overlap.other.callback)} ran {at_once}"


def _exclusion_hint(recording: Recording, names: Sequence[str], overlap: Overlap) -> str:
    if concurrency.forbids(recording, itself=overlap.one.callback == overlap.other.callback):
        return (
            "The executor and the groups would not allow it, so something else runs the work: a "
            "thread that a callback starts, a second executor or a second process. Work in the "
            "callback itself, from its first report to its last."
        )
    return (
        f"A SingleThreadedExecutor, which {SPIN_NODE} uses too, runs one callback at a time; "
        f"with a MultiThreadedExecutor only those of one {EXCLUSIVE} do: "
        + worded(
            python="self.create_subscription(..., callback_group=self.group).",
            cpp="rclcpp::SubscriptionOptions has a callback_group.",
        )
        + f" In a {REENTRANT} a callback may run again while it still runs."
    )


def _all(found: Sequence[Overlap]) -> list[Run]:
    return [item for overlap in found for item in (overlap.one, overlap.other)]


def _declared(recording: Recording) -> str:
    """What the declarations tell, to follow what was seen."""
    declared = concurrency.declared_words(recording)
    return f"; {declared}" if declared else ""


class Overlapping(Reported):
    """Parameters of callbacks.overlap."""

    others: tuple[str, ...] = Field(
        min_length=1, description="Callbacks to overlap with. Each of `callbacks` must overlap with any of these."
    )
    at_least: int = Field(2, ge=1, description="How often.")
    by: Duration = Field(
        0.05,
        description="Least time that both must overlap.",
        validate_default=False,
    )

    def _asked(self) -> str:
        return (
            f"{codes(self.callbacks)} running at the same time as {codes(self.others, 'or')}, "
            f"{counted(self.at_least, 'time')} or more by {format_duration(self.by)}"
        )


@check("callbacks.overlap", Subject.RECORDING, Overlapping, concept="executors")
def overlap(recording: Recording, parameters: Overlapping) -> Finding:
    """Callbacks run at the same time.

    Each of the named callbacks must overlap with one of the others, at least `at_least` times by
    `by` or longer. Judged by their reports on the wire; the executor and the callback groups that
    the process declared help to explain. Where one mutually exclusive group kept the callbacks
    apart, a busy machine is no excuse.

    A MultiThreadedExecutor takes as many threads as there are CPUs; the grader gives it four at
    least, and os.cpu_count() says so.
    """
    reports = read_reports(recording.on(parameters.topic))
    names = (*parameters.callbacks, *parameters.others)
    stop_if(why_reports_are_missing(recording, parameters.topic, names, reports))
    parts = []
    for callback in parameters.callbacks:
        number = len(_with_others(reports, callback, parameters, parameters.by))
        parts.append(f"{code(callback)} did so {counted(number, 'time')}")
        if number < parameters.at_least:
            return _serial(recording, parameters, reports, callback, number)
    return Finding.as_asked(listing(parts), Evidence(spans=spans(recording, reports)))


def _with_others(
    reports: Reports, callback: str, parameters: Overlapping, least_s: float
) -> list[Overlap]:
    runs = reports.ended({callback, *parameters.others})
    return [
        item
        for item in overlaps(runs, least_s)
        if callback in (item.one.callback, item.other.callback)
        and {item.one.callback, item.other.callback} - {callback} & set(parameters.others)
    ]


def _serial(
    recording: Recording,
    parameters: Overlapping,
    reports: Reports,
    callback: str,
    number: int,
) -> Finding:
    """The finding of a callback that does not overlap often enough."""
    seen = f"only {counted(number, 'time')}" if number else "never"
    observed = f"{code(callback)} {seen} ran at the same time as {codes(parameters.others, 'or')}"
    names = {callback, *parameters.others}
    ended = reports.ended(names)
    most = number + _prevented(recording, parameters, reports, callback)
    # With several threads, those of rclcpp that wait for the group take the CPU from each other.
    prevented = most >= parameters.at_least and not concurrency.kept_apart(recording, ended)
    stop_if(concurrency.not_judged(recording, observed, prevented=prevented))
    return Finding(
        observed + _declared(recording),
        _concurrency_hint(recording, len(names)),
        Evidence(
            moments=(Moment("first run", recording.since_launch_s(ended[0].begin_ns)),),
            spans=spans(recording, reports, reports.of(callback)),
        ),
    )


def _prevented(
    recording: Recording, parameters: Overlapping, reports: Reports, callback: str
) -> int:
    """How many more runs could have overlapped had the host taken nothing, at most."""
    others = reports.ended(parameters.others)
    done = {item for both in _with_others(reports, callback, parameters, parameters.by)
            for item in (both.one, both.other)}  # fmt: skip
    found = 0
    for one in reports.ended([callback]):
        if one in done:
            continue
        for other in others:
            first, second = sorted((one, other), key=lambda item: item.begin_ns)
            lacking_s = (second.begin_ns - (first.end_ns or 0)) / NS + parameters.by
            stolen_s = recording.stolen_s(first.begin_ns, second.begin_ns)
            if other is not one and stolen_s >= lacking_s:
                found += 1
                break
    return found


def _concurrency_hint(recording: Recording, callbacks: int) -> str:
    if concurrency.single(recording):
        return (
            f"{SPIN_NODE} and a SingleThreadedExecutor run one callback at a time. Create "
            + worded("a MultiThreadedExecutor()", "an rclcpp::executors::MultiThreadedExecutor")
            + ", give it the node with add_node(node), and call its spin()."
        )
    if concurrency.shares_exclusive_group(recording):
        return (
            f"Without {worded('callback_group=...', 'a callback group')} every timer and "
            "subscription is in the node's default group, which is mutually exclusive. Create "
            + worded(
                python="a ReentrantCallbackGroup() and give it to both timers: "
                "self.create_timer(1.0, self.callback, callback_group=self.group).",
                cpp="a group, this->create_callback_group(rclcpp::CallbackGroupType::Reentrant), "
                "keep it in a member, and give it to both timers: "
                "this->create_wall_timer(1.0s, callback, group_).",
            )
        )
    if concurrency.allows(recording) and concurrency.threads(recording) < callbacks:
        return (
            f"{callbacks} callbacks can run at once only if the executor has {callbacks} threads "
            f"or more: {concurrency.executor_with(callbacks + 1)}."
        )
    if concurrency.allows(recording):
        return (
            "The executor and the groups would allow it, so something else makes one callback "
            "wait for the other: look for a lock, for timers that do not fire together, and for "
            "callbacks of one mutually exclusive group."
        )
    return (
        "It takes both: a MultiThreadedExecutor with two threads or more, and callbacks that are "
        f"in a {REENTRANT} or in different groups."
    )
