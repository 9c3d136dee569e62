"""A check in windows of a run: it must pass in each of them, and there must be one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from grader.checks.lifecycle.lifecycle import transition, why_not_managed
from grader.checks.window import Phase, Window
from grader.diagnosis.explanation import cause_of
from grader.diagnosis.no_answer import NoAnswer
from grader.diagnosis.no_endpoint import SERVICE
from grader.diagnosis.no_messages import why_not_sent, why_silent
from grader.diagnosis.process.not_called import ANSWER_S
from grader.diagnosis.process.process_exit import why_ended
from grader.findings.fields import difference_words, unlike
from grader.findings.finding import Evidence, Finding, first_seen, until_the_end
from grader.findings.value import EXACT
from grader.findings.words import code, counted, listing, worded
from grader.grade.model import SEVERITY
from grader.recording.model import Kind, Owner, Recording
from grader.recording.window import cut


def judged_in(
    window: Window, judge: Callable[[Any, Any], Finding], recording: Recording, parameters: Any
) -> Finding:
    """The worst finding of all windows; if there is none, why."""
    intervals = window.intervals(recording)
    if not intervals:
        expected = f"a time {window}: this is judged then"
        return replace(_why_never(recording, window), expected=expected)
    found = [judge(cut(recording, *one), parameters) for one in intervals]
    worst = min(found, key=lambda one: (SEVERITY.index(one.status), one.credit))
    return replace(worst, expected=f"{window}: {worst.expected}")


def _why_never(recording: Recording, window: Window) -> Finding:
    for phase in (window.after, window.while_):
        if phase is not None and not phase.intervals(recording):
            return _why_not(recording, phase)
    ended_s = recording.since_launch_s(recording.stop_ns)
    seen = f"there was none before the run ended {ended_s:.2f} s after launch"
    # A window of times alone does not depend on the student: the mistake is the assignment's.
    shown = Evidence(moments=(until_the_end(recording),))
    hint = "Look at the order in which this happens, and whether it happens at all."
    never = Finding(seen, hint, shown) if window.phases else Finding.ours(seen, hint)
    return why_ended(recording, seen) or never


def _why_not(recording: Recording, phase: Phase) -> Finding:
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
        missing = why_not_managed(recording, phase.node)
        if missing is not None:
            return missing
        changes = [one for one in recording.calls if one.service == f"{phase.node}/change_state"]
        answers = {True: "succeeded", False: "failed", None: "was not answered"}
        results = [(one.response or {}).get("success") for one in changes]
        steps = [
            f"{transition(one)} {answers[result]}"
            for one, result in zip(changes, results, strict=True)
        ]
        seen = f"{code(phase.node)} was never {phase.lifecycle}"
        seen += f": {listing(steps, 'then')}" if steps else ""
        if True in results and not recording.on(f"{phase.node}/transition_event"):
            return Finding.undecided(f"{seen}, but the probe received none of its events")
        bad = [one for one, result in zip(changes, results, strict=True) if result is not True]
        if bad and bad[0].answered_ns is None:
            asked = (bad[0].service, bad[0].requested_ns, ANSWER_S)
            return cause_of(NoAnswer(recording, seen, SERVICE, *asked))
        if bad:
            success = worded("TransitionCallbackReturn.SUCCESS", "CallbackReturn::SUCCESS")
            hint = (
                "The callbacks of transitions (on_configure, on_activate, ...) must return "
                f"{success}."
            )
            # What failed later, or ended the process, came of it.
            return Finding(seen, hint, shown)
    return why_ended(recording, seen) or Finding(seen, hint, shown)
