"""Why callbacks that should report on a topic cannot be judged: no node reports, or reports otherwise."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from pydantic import Field

from grader.checks.check import Parameters
from grader.findings.finding import Evidence, Moment, Table, Finding
from grader.checks.need import Need, Recorded
from grader.findings.words import code, codes, counted, value_text
from grader.diagnosis.no_messages import why_silent
from grader.diagnosis.process.not_called import held_up_below
from grader.diagnosis.process.process_exit import why_ended
from grader.findings.words import Words, worded
from grader.recording.model import NS, Recording
from grader.spec.name import TopicName
from grader.spec.nearest_name import nearest
from grader.spec.unit import format_duration

from .callback_run import Reports, spans

_FORMAT_HINT = (
    "Publish a String with the name of the callback, a space and `start` as the first thing in "
    "the callback, and the same with `end` as the last, such as `timer_1 start`."
)
SECONDS_HINT = Words(
    python="time.sleep and create_timer take seconds: 0.4 is 400 ms.",
    cpp="sleep_for and create_wall_timer take a time with its unit: 400ms, and not 0.4.",
)


class Reported(Parameters):
    """Parameters of every check of reported callbacks."""

    needs: ClassVar[tuple[Need, ...]] = (Recorded(),)

    topic: TopicName = Field(
        description="Topic of std_msgs/msg/String on which callbacks report `<callback> start` "
        "and `<callback> end`."
    )
    callbacks: tuple[str, ...] = Field(min_length=1, description="Names of the callbacks.")


def why_reports_are_missing(
    recording: Recording,
    topic: str,
    callbacks: Sequence[str],
    reports: Reports,
    at_least: int = 1,
) -> Finding | None:
    """Why a callback did not report enough complete runs, or None if all did.

    Args:
        at_least: How many complete runs each must have.
    """
    messages = recording.on(topic)
    if not messages:
        return why_silent(recording, topic)
    missing = [name for name in callbacks if len(reports.ended([name])) < at_least]
    if not missing:
        return None
    rows = tuple((str(message.value.get("data")),) for message in messages[:5])
    evidence = Evidence(
        moments=(Moment("first message", recording.since_launch_s(messages[0].stamp_ns)),),
        spans=spans(recording, reports),
        tables=(Table(f"First messages on {topic}", ("data",), rows),),
    )
    name = missing[0]
    if reports.strange and not reports.runs:
        return Finding(
            f"no message on {code(topic)} is a report of a callback: there is "
            f"{value_text(reports.strange[0])}, for example",
            _FORMAT_HINT,
            evidence,
        )
    strangers = [item for item in reports.callbacks if item not in callbacks]
    # Something may have been put before or after the name, such as that of the node.
    other = nearest(name, strangers) or next((item for item in strangers if name in item), None)
    if other is not None and not reports.of(name):
        return Finding(
            f"no report of {code(name)}, but reports of {code(other)}",
            f"A report is {code(f'{name} start')} or {code(f'{name} end')}, exactly so, with "
            "nothing before it or after it.",
            evidence,
        )
    return why_ended(recording, f"no complete run of {code(name)}") or _incomplete(
        recording, reports, name, at_least, evidence
    )


def _incomplete(
    recording: Recording, reports: Reports, name: str, at_least: int, evidence: Evidence
) -> Finding:
    begun, ended = len(reports.of(name)), len(reports.ended([name]))
    begin_ns = recording.matched_ns or recording.launched_ns
    watched_s = (recording.stop_ns - begin_ns) / NS
    ran, span_ns = f"{code(name)} ran {counted(ended, 'time')}", (begin_ns, recording.stop_ns)
    if held_up := held_up_below(recording, ran, ended, at_least, span_ns):
        return held_up
    if begun > ended:
        return Finding(
            f"{code(name)} reported {counted(begun, 'start')}, but {ended or 'no'} "
            f"{'end' if ended == 1 else 'ends'}",
            "Publish the end as the last thing in the callback; it must return. Look for a loop, "
            + worded(
                python="a long time.sleep (it takes seconds)",
                cpp="a long std::this_thread::sleep_for() (300ms is not 300s)",
            )
            + ", an exception, and rate.sleep(), which waits for ever in a callback of the only "
            "thread.",
            evidence,
        )
    if name in reports.orphans:
        return Finding(f"{code(name)} reported its end, but never its start", _FORMAT_HINT, evidence)
    if not begun:
        others = [item for item in reports.callbacks if item != name]
        seen = f"; reports came of {codes(others)}" if others else ""
        return Finding(
            f"{code(name)} never ran{seen}",
            worded(
                python="Is its timer or its subscription created in the constructor, with the "
                "period in seconds, and does it report under this name?",
                cpp="Is its timer or its subscription created in the constructor, with the unit of "
                "the period, such as 300ms, and does it report under this name? Keep it and its "
                "callback group in members of the class: what only a local variable holds ends "
                "with the constructor.",
            )
            + " A callback that does not return keeps the others of its group from running.",
            evidence,
        )
    return Finding(
        f"{code(name)} ran only {counted(ended, 'time')} in {format_duration(watched_s)}, of "
        f"{at_least} that are needed",
        f"{SECONDS_HINT} A callback that works for long lets the others of its group wait.",
        evidence,
    )
