"""A check in windows of a run: it must pass in each of them, and there must be one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from grader.checks.window import Phase, Window
from grader.diagnosis.never_so import (
    why_never,
    why_never_in_state,
    why_no_such_message,
    why_not_in_order,
)
from grader.diagnosis.process.process_exit import why_ended
from grader.findings.finding import Finding
from grader.grade.model import SEVERITY
from grader.recording.model import Recording
from grader.recording.window import cut


def judged_in(
    window: Window, judge: Callable[[Any, Any], Finding], recording: Recording, parameters: Any
) -> Finding:
    """The worst finding of all windows; if there is none, why."""
    intervals = window.intervals(recording)
    if not intervals:
        expected = f"a time {window}: this is judged then"
        return replace(_why_never(recording, window), expected=expected)
    findings = [judge(cut(recording, *interval), parameters) for interval in intervals]
    worst = min(findings, key=lambda finding: (SEVERITY.index(finding.status), finding.credit))
    return replace(worst, expected=f"{window}: {worst.expected}")


def _why_never(recording: Recording, window: Window) -> Finding:
    for phase in (window.after, window.while_):
        if phase is not None and not phase.intervals(recording):
            return _why_not(recording, phase)
    ended_s = recording.since_launch_s(recording.stop_ns)
    seen = f"there was none before the run ended {ended_s:.2f} s after launch"
    # A window of times alone does not depend on the student: the mistake is the assignment's.
    if not window.phases:
        return why_ended(recording, seen) or Finding.ours(seen)
    return why_not_in_order(recording, seen)


def _why_not(recording: Recording, phase: Phase) -> Finding:
    """Why something never happened, or was never so."""
    if phase.message is not None:
        return why_no_such_message(recording, phase.message, phase.fields)
    if phase.node is not None:
        return why_never_in_state(recording, phase.node, str(phase.lifecycle))
    return why_never(recording, f"never: {phase.asked_for}")
