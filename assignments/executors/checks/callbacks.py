"""Checks of callbacks that report when they start and end: how often, how long, at once or not."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from statistics import median

from pydantic import Field, model_validator

from grader.measure import declarations
from grader.checks.check import Subject, check, stop_if
from grader.findings.finding import Evidence, Finding
from grader.checks.need import PUBLISHED, Recorded
from grader.measure.period import Interval, PeriodLimits, forgiven, judge
from grader.checks.tolerance import TimeTolerance, Tolerance
from grader.findings.words import code, codes, counted, listing
from grader.diagnosis.no_messages import why_not_sent
from grader.diagnosis.destroyed_endpoint import why_unsubscribed
from grader.diagnosis.process.process_exit import why_ended
from grader.findings.words import worded
from grader.recording.model import NS, Recording
from grader.spec.name import TopicName
from grader.spec.quantity import Duration
from grader.spec.unit import format_duration

from .callback_run import Reports, read_reports, spans
from .missing_reports import SECONDS_HINT, Reported, why_reports_are_missing

# Between two callbacks of a busy executor.
_PAUSE_S = 0.1
# Between the end of the work that a timer waited for and its start, besides what the machine took.
_NEXT_S = 0.05
_GAINED = 0.25
"""Share of its period by which a timer may seem to have gained."""



class Runs(Reported):
    """Parameters of callbacks.run."""

    needs = (Recorded(), PUBLISHED)

    period: Duration | None = Field(
        None, description="Expected time between two starts of each callback."
    )
    stimulus: TopicName | None = Field(
        None, description="Topic on which the probe publishes: each message must be worked on once."
    )
    tolerance: Tolerance = Field(
        TimeTolerance(0.10, relative=True),
        description="How far the median of the times between starts may be from the period: a "
        "share of it or a time.",
    )
    at_least: int = Field(3, ge=1, description="How often each callback must have run.")

    @model_validator(mode="after")
    def _one_way(self) -> Runs:
        if self.period is not None and self.stimulus is not None:
            raise ValueError("say what calls them: give either 'period' or 'stimulus', or neither")
        return self

    def _asked(self) -> str:
        names, reports = codes(self.callbacks), f"report start and end on {code(self.topic)}"
        each = "each " if len(self.callbacks) > 1 else ""
        if self.period is not None:
            within = f"(median within {self.tolerance})"
            return f"{names} {each}start every {format_duration(self.period)} {within}, and {reports}"
        if self.stimulus is not None:
            return f"{names} {each}run once for each message on {code(self.stimulus)}, and {reports}"
        return f"{names} {each}run {counted(self.at_least, 'time')} or more, and {reports}"


@check("callbacks.run", Subject.RECORDING, Runs, concept="executors")
def run(recording: Recording, parameters: Runs) -> Finding:
    """Callbacks run as often as expected.

    A timer's callback starts once in each `period` (the median of the times between its starts); a
    subscription's callback runs once for each message that the probe sent; messages that still wait
    at the end because other callbacks work without a pause do not count. Each run must have
    reported its start and its end. Without `period` and `stimulus` it is enough that each callback
    ran `at_least` times. A start that is late because other callbacks worked without a pause counts
    as on time: other checks judge overlap. A start before its time is always wrong.
    """
    reports = read_reports(recording.on(parameters.topic))
    free = parameters.period is None and parameters.stimulus is None
    names, least = parameters.callbacks, parameters.at_least if free else 1
    stop_if(why_reports_are_missing(recording, parameters.topic, names, reports, least))
    for callback in () if free else names:
        if parameters.period is not None:
            stop_if(_judge_period(recording, parameters, reports, callback, parameters.period))
        else:
            stop_if(_judge_messages(recording, parameters, reports, callback))
    return Finding.as_asked(
        listing(
            f"{code(name)} ran {counted(len(reports.of(name)), 'time')}"
            for name in names
        ),
        Evidence(spans=spans(recording, reports)),
    )


def _judge_period(
    recording: Recording, parameters: Runs, reports: Reports, callback: str, period_s: float
) -> Finding | None:
    """The finding of a callback that does not run at its period, or None."""
    begins = _unhindered(recording, reports, callback, period_s)
    measured = [
        Interval(a, b, (b - a) / NS, begins[max(0, index - 1)])
        for index, (a, b) in enumerate(pairwise(begins))
    ]
    limits = PeriodLimits(period_s, parameters.tolerance.of(period_s), math.inf, 0.0)
    seconds = [item.seconds for item in measured]
    good = bool(seconds) and judge(seconds, limits).good
    evidence = Evidence(spans=spans(recording, reports, reports.of(callback)))
    gained_s, excused_s = _gained_s(recording, begins, period_s)
    if good and gained_s > _GAINED * period_s and not _declares(recording, parameters, limits):
        observed = (
            f"{code(callback)} starts {counted(len(begins), 'time')} in "
            f"{format_duration((begins[-1] - begins[0]) / NS)}: too often, and held up by others"
        )
        if gained_s - excused_s <= _GAINED * period_s:
            return Finding.undecided(f"{observed}, unless it was the machine that held it up")
        return Finding(observed, _period_hint(recording), evidence)
    if good and len(reports.ended([callback])) >= parameters.at_least:
        return _by_chance(recording, parameters, reports, callback, limits)
    if seconds and not good:
        middle_s = median(seconds)
        observed = f"{code(callback)} starts every {format_duration(middle_s)} (median)"
        if judge(forgiven(recording, measured, limits), limits).good:
            return Finding.undecided(f"{observed}, but the machine took the time from the process")
        return Finding(observed, _period_hint(recording), evidence)
    return why_reports_are_missing(
        recording, parameters.topic, parameters.callbacks, reports, parameters.at_least
    )


def _declares(recording: Recording, parameters: Runs, limits: PeriodLimits) -> bool:
    """Whether the process declared a timer of the right period for each callback, and no other.

    Callbacks that wait for a lock do not get it in order: a callback that was late behind another
    one for a long time may come first, on time and hence early. In the messages that looks like a
    shorter period.
    """
    timers = declarations.timers(recording)
    right = [timer for timer in timers if judge([timer.period_s], limits).good]
    return 0 < len(right) == len(timers) <= len(parameters.callbacks)


def _by_chance(
    recording: Recording, parameters: Runs, reports: Reports, callback: str, limits: PeriodLimits
) -> Finding | None:
    """The finding where the work alone may have made the period, or None.

    An executor that is never free calls each of its timers when it can, however short
    their periods are. Only then it matters what the process declared, and it decides nothing.
    """
    begins = [item.begin_ns for item in reports.of(callback)]
    if not all(_worked(recording, reports, one, other) for one, other in pairwise(begins)):
        return None
    declared_s = {timer.period_s for timer in declarations.timers(recording)}
    if not declared_s or any(judge([period_s], limits).good for period_s in declared_s):
        return None
    return Finding.undecided(
        f"{code(callback)} starts as often as it should, but the executor was never free between "
        f"its starts, and the process declared "
        f"{listing(f'a timer of {format_duration(item)}' for item in sorted(declared_s))}: "
        "its period does not show",
    )


def _gained_s(recording: Recording, begins: Sequence[int], period_s: float) -> tuple[float, float]:
    """By how much the later starts come before their time, if the earlier ones came on time.

    A timer's starts may be late but never early: once one of the first half was on time, nothing
    of what holds it up brings another forward. The median of an executor that is never free may
    have any value, its period among them.

    Returns:
        That, and how much of it the machine may have made; both in seconds.
    """
    phases = [(begin - begins[0]) / NS - number * period_s for number, begin in enumerate(begins)]
    half = len(phases) // 2
    if not half:
        return 0.0, 0.0
    stolen_s = recording.stolen_s(begins[0] - round(period_s * NS), begins[half])
    return min(phases[:half]) - min(phases[half:]), stolen_s


def _unhindered(
    recording: Recording, reports: Reports, callback: str, period_s: float
) -> list[int]:
    """Starts of a timer's callback, without the delay by callbacks that worked until then.

    Whether those should have run at the same time is judged elsewhere.
    """
    found: list[int] = []
    for item in reports.of(callback):
        due_ns = found[-1] + round(period_s * NS) if found else item.begin_ns
        before = [
            other.end_ns or recording.stop_ns
            for other in reports.runs
            if other.begin_ns < item.begin_ns
        ]
        newest_ns = max(before, default=0)
        # What begins while others still work did not wait for them, and what begins a while after
        # them was not due before.
        idle_s = (item.begin_ns - newest_ns) / NS
        waited = due_ns < newest_ns <= item.begin_ns and idle_s <= _NEXT_S + recording.stolen_s(
            newest_ns, item.begin_ns
        )
        hindered = waited and _worked(recording, reports, due_ns, item.begin_ns)
        found.append(min(due_ns, item.begin_ns) if hindered else item.begin_ns)
    return found


def _worked(recording: Recording, reports: Reports, from_ns: int, to_ns: int) -> bool:
    """Whether callbacks worked without a pause from one time to another."""
    free_ns = from_ns
    for item in reports.runs:
        if item.begin_ns >= to_ns or item.begin_ns - free_ns > _PAUSE_S * NS:
            break
        free_ns = max(free_ns, item.end_ns or recording.stop_ns)
    return to_ns - free_ns <= _PAUSE_S * NS


def _period_hint(recording: Recording) -> str:
    return _made_twice(recording) or (
        f"{SECONDS_HINT} A callback that is given to two timers runs twice as often. While a "
        "callback works, no other callback of its executor or group begins: several that work "
        "longer than a period together are late."
    )


def _made_twice(recording: Recording) -> str:
    """What to try where a process made a node twice, with all of its callbacks; else nothing."""
    made = Counter((item.process, str(item.data.get("node"))) for item in recording.declared("node"))
    name = next((name for (_, name), number in made.items() if name and number > 1), "")
    return name and (
        f"The process made the node {code(name)} twice, and each has its own timers and "
        "subscriptions. Make it once, and hand this one to the executor."
    )


def _judge_messages(
    recording: Recording, parameters: Runs, reports: Reports, callback: str
) -> Finding | None:
    """The finding of a callback that does not run once for each message, or None."""
    sent = recording.sent.get(parameters.stimulus or "", ())
    if not sent:
        return why_not_sent(recording, parameters.stimulus or "")
    begun, ended = len(reports.of(callback)), len(reports.ended([callback]))
    evidence = Evidence(spans=spans(recording, reports, reports.of(callback)))
    observed = (
        f"{code(callback)} started {counted(begun, 'time')} and ended {counted(ended, 'time')} for "
        f"{counted(len(sent), 'message')}"
    )
    if begun > len(sent):
        return Finding(
            observed,
            _made_twice(recording)
            or "Create one subscription, and report the start and the end once in its callback.",
            evidence,
        )
    if ended == len(sent) or (ended >= parameters.at_least and _busy(recording, reports, callback)):
        return None
    cause = why_ended(recording, observed) or why_unsubscribed(
        recording, parameters.stimulus or "", observed, sent[-1].stamp_ns
    )
    if cause is not None:
        return cause
    work_s = max((item.seconds or 0.0 for item in reports.ended([callback])), default=0.0)
    missing_s = (len(sent) - ended) * work_s
    if recording.stolen_s(sent[0].stamp_ns, recording.stop_ns) >= missing_s > 0.0:
        return Finding.undecided(f"{observed}, but the machine took the time from the process")
    return Finding(
        observed,
        "A queue size of 10 keeps the messages that come while the callback works. Look for a "
        "callback that works too long, for one that blocks the executor, and for "
        "an `if` that leaves messages out.",
        evidence,
    )


def _busy(recording: Recording, reports: Reports, callback: str) -> bool:
    """Whether callbacks worked without a pause from the newest run of one until the end.

    What waits then is in a queue; whether callbacks should have run at the same time is judged
    elsewhere.
    """
    newest_ns = max(item.end_ns or recording.stop_ns for item in reports.of(callback))
    return _worked(recording, reports, newest_ns, recording.stop_ns)


class Work(Reported):
    """Parameters of callbacks.work."""

    duration: Duration = Field(description="Expected duration of each run.")
    tolerance: Tolerance = Field(
        TimeTolerance(0.15, relative=True),
        description="How far the median may be from it: a share of it or a time.",
    )

    def _asked(self) -> str:
        return (
            f"{codes(self.callbacks)} working {format_duration(self.duration)} in each run "
            f"(median within {self.tolerance})"
        )


@check("callbacks.work", Subject.RECORDING, Work)
def work(recording: Recording, parameters: Work) -> Finding:
    """Callbacks work as long as expected.

    The time between the report of the start and that of the end, by source timestamps: the median
    of each callback's runs must be the duration within `tolerance`. Delays by the machine cost no
    points.
    """
    reports = read_reports(recording.on(parameters.topic))
    stop_if(why_reports_are_missing(recording, parameters.topic, parameters.callbacks, reports))
    allowed_s = parameters.tolerance.of(parameters.duration)
    parts = []
    for callback in parameters.callbacks:
        found = reports.ended([callback])
        seconds = [item.seconds or 0.0 for item in found]
        middle_s = median(seconds)
        parts.append(f"{code(callback)} works {format_duration(middle_s)}")
        if abs(middle_s - parameters.duration) <= allowed_s:
            continue
        excused_s = median(
            value - recording.stolen_s(item.begin_ns, item.end_ns or item.begin_ns)
            for value, item in zip(seconds, found, strict=True)
        )
        if middle_s > parameters.duration and excused_s <= parameters.duration + allowed_s:
            return Finding.undecided(f"{parts[-1]}, but the machine took the time from the process")
        return Finding(
            f"{parts[-1]} (median of {counted(len(seconds), 'run')})",
            "Report the start, then work with "
            + worded(
                python=f"time.sleep({parameters.duration:g})",
                cpp=f"std::this_thread::sleep_for({parameters.duration:g}s)",
            )
            + f", then report the end. {SECONDS_HINT} If it takes longer, something else waits "
            "between the two reports, such as for a lock.",
            Evidence(spans=spans(recording, reports, found)),
        )
    return Finding.as_asked(listing(parts), Evidence(spans=spans(recording, reports)))
