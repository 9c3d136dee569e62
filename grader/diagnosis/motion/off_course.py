"""Why a robot left its course, for reasons that do not depend on how it is steered."""

from __future__ import annotations

from grader.diagnosis.explanation import mistaken
from grader.diagnosis.motion.contact import why_touched
from grader.diagnosis.motion.no_motion import why_cut_short, why_misread
from grader.diagnosis.no_messages import why_unheard
from grader.findings.finding import Finding, evidence_at
from grader.measure.motion.command import commands, is_zero
from grader.measure.motion.track import speed_plot
from grader.recording.model import NS, Recording
from grader.spec.unit import format_duration

# No controller that steers by odometry, or by a timer, waits for so long.
_UNSTEERED_S = 2.0


def why_interrupted(recording: Recording) -> Finding | None:
    """Why the way ended early: a process ended, commands not finite, or a contact; or None."""
    return why_cut_short(recording) or why_touched(recording)


def why_off_course(recording: Recording) -> Finding | None:
    """A cause that lies deeper than the way in which the robot is steered, or None."""
    return (
        why_interrupted(recording)
        or why_misread(recording)
        or why_unheard(recording)
        or why_unsteered(recording)
    )


def why_unsteered(recording: Recording) -> Finding | None:
    """The longest time without a command in which the robot moved on; None if it is short."""
    end_ns = recording.truth[-1].time_ns
    sent = commands(recording)
    ends_ns = [*(command.time_ns for command in sent[1:]), end_ns]
    # Without any command there is one end too many.
    moving_ns = [
        (command.time_ns, next_ns)
        for command, next_ns in zip(sent, ends_ns, strict=False)
        if not is_zero(command.twist)
    ]
    begin_ns, next_ns = max(moving_ns, key=lambda span: span[1] - span[0], default=(0, 0))
    long_s = (next_ns - begin_ns) / NS
    if long_s - recording.stolen_s(begin_ns, next_ns) < _UNSTEERED_S:
        return None
    when_s = recording.since_launch_s(begin_ns)
    until = " until the observation ended" if next_ns == end_ns else ""
    return mistaken(
        "unsteered",
        f"no command came for {format_duration(long_s)}{until}, from {when_s:.2f} s after launch "
        "on, and the robot kept moving by its last command",
        evidence_at(recording, "no command from here on", begin_ns, speed_plot(recording)),
    )
