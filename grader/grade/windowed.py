"""A check in windows of a run: it must pass in each of them, and there must be one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from grader.checks.window import Phase, Window, transition
from grader.diagnosis.cause import Cause
from grader.diagnosis.no_messages import why_not_sent, why_silent
from grader.diagnosis.no_node import why_not_node
from grader.diagnosis.process.process_exit import why_ended
from grader.findings.fields import difference_words, unlike
from grader.findings.finding import Evidence, Finding
from grader.findings.first_seen import first_seen, until_the_end
from grader.findings.value import EXACT
from grader.findings.wording import code, counted, listing
from grader.grade.model import SEVERITY
from grader.recording.model import Kind, Owner, Recording
from grader.recording.window import cut


def judged_in(
    window: Window, judge: Callable[[Any, Any], Finding], recording: Recording, parameters: Any
) -> Finding:
    """The worst finding of all windows; if there is none, why."""
    intervals = window.intervals(recording)
    if not intervals:
        return _why_never(recording, window).finding(f"a time {window}: this is judged then")
    found = [judge(cut(recording, *one), parameters) for one in intervals]
    worst = min(found, key=lambda one: (SEVERITY.index(one.status), one.credit))
    return replace(worst, expected=f"{window}: {worst.expected}")


def _why_never(recording: Recording, window: Window) -> Cause:
    for phase in (window.after, window.while_):
        if phase is not None and not phase.intervals(recording):
            return _why_not(recording, phase)
    ended_s = recording.since_launch_s(recording.stop_ns)
    seen = f"there was none before the run ended {ended_s:.2f} s after launch"
    # Only the assignment's own times, and no doing of the student's, are nobody's mistake there.
    shown = Evidence(moments=(until_the_end(recording),))
    hint = "Look at the order in which this happens, and whether it happens at all."
    return why_ended(recording, seen) or Cause(seen, hint, shown, ours=not window.phases)


def _why_not(recording: Recording, phase: Phase) -> Cause:
    """Why something never happened, or was never so."""
    topic, seen, hint = phase.message, f"never: {phase.asked_for}", "Does the node get so far?"
    shown = Evidence(moments=(until_the_end(recording),))
    if topic is not None:
        messages = recording.carried(topic)
        ours = {
            one.topic
            for one in recording.endpoints
            if one.owner is Owner.PROBE and one.kind is Kind.PUBLISHER
        }
        if not messages:
            return (why_not_sent if topic in ours else why_silent)(recording, topic)
        wrong = difference_words(unlike(messages[-1].value, phase.fields, EXACT))
        seen = f"none of {counted(len(messages), 'message')} on {code(topic)}: the last has {wrong}"
        shown = Evidence(moments=first_seen(recording, messages))
    elif phase.node is not None:
        asked = [
            f"{transition(one)} {'succeeded' if (one.response or {}).get('success') else 'failed'}"
            for one in recording.calls
            if one.service == f"{phase.node}/change_state"
        ]
        seen = f"{code(phase.node)} was never {phase.lifecycle}: {listing(asked, 'then')}"
        hint = (
            "Inherit from rclpy.lifecycle.LifecycleNode; on_configure() and the other callbacks "
            "return TransitionCallbackReturn.SUCCESS."
        )
        missing = why_not_node(recording, phase.node)
        if missing is not None:
            return missing
    return why_ended(recording, seen) or Cause(seen, hint, shown)
