"""Failures that may be an accident of a disturbed run, and so must happen twice to count."""

from __future__ import annotations

import signal

from grader.checks.need import Doubt
from grader.measure.motion.command import stolen_s
from grader.recording.model import NS, Recording

# As long as a timer of 10 Hz makes a command wait anyway; tolerances are made for that.
_STALL_S = 0.1
_STALL_WINDOW_NS = NS // 2
HELD_UP_S = 0.1
"""As long as a wait on a quiet machine may take."""


def is_doubtful(recording: Recording, doubt: Doubt | None) -> bool:
    """Whether the failure of a check may be an accident of its run."""
    if _was_signalled(recording):
        return True
    if doubt is Doubt.STEERING_HELD_UP:
        return _was_out_of_hand(recording)
    return doubt is Doubt.ANSWER_MISSED and _did_not_meet(recording)


def _was_signalled(recording: Recording) -> bool:
    """Whether a signal ended a process that another process may have sent."""
    if any(breach.ended for breach in recording.breaches):
        return False
    return any(
        process.stopped_by == "itself" and process.exit_code in (-signal.SIGKILL, -signal.SIGSTOP)
        for process in recording.processes
    )


def _was_out_of_hand(recording: Recording) -> bool:
    """Whether the machine held up the control loop for a while: many short waits do not count."""
    if not recording.truth:
        return False
    begin_ns, end_ns = recording.truth[0].time_ns, recording.truth[-1].time_ns
    return any(
        stolen_s(recording, item.time_ns, item.time_ns + _STALL_WINDOW_NS) > _STALL_S
        for item in recording.disturbance
        if begin_ns <= item.time_ns <= end_ns and item.waited_ns + item.late_ns
    )


def _did_not_meet(recording: Recording) -> bool:
    """Whether an answer is missing on a machine so busy that client and server may not have met."""
    answered = {call.service for call in recording.calls if call.answered_ns is not None}
    silent = any(call.service not in answered for call in recording.calls) or any(
        goal.answered_ns is None for goal in recording.goals
    )
    return silent and recording.stolen_s(recording.launched_ns, recording.stop_ns) > HELD_UP_S
