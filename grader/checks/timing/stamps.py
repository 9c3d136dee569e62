"""Whether the source timestamps of messages, which their writer gives, agree with arrivals."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from statistics import median

from grader.checks.finding import Evidence, Moment
from grader.checks.wording import counted
from grader.diagnosis.cause import Cause
from grader.recording.model import NS, Message, Recording
from grader.spec.unit import format_duration

# Arrivals and source timestamps may differ so much in their medians, or in a single message.
_RELATIVE = 0.20
_ABSOLUTE_S = 0.020
_CLOCK_SLACK_NS = 50_000_000
# Fewer arrivals have no meaningful median.
_FEWEST = 3
# Single messages may be lost on their way, and are sent again.
_MOST_LATE, _LATE_SHARE = 3, 0.2
_AROUND_NS = NS // 10
_STAMPING = ("rmw_fastrtps_cpp",)
"""Middleware that stamps every message."""
_HINT = "Publish when the time has come, and leave the clock of the process alone."


def why_not_believed(recording: Recording, messages: Sequence[Message]) -> Cause | None:
    """Why the source timestamps of these messages do not tell when they were published.

    Returns:
        A cause, an error where the host's disturbance may explain the difference, or None. What
        the middleware alone may have held up has to happen twice.
    """
    given = any(message.stamp_ns for message in messages)
    if not given and recording.environment.get("rmw") not in _STAMPING:
        return Cause("the middleware gave no source timestamps", ours=True)
    for message in messages:
        begin_ns = recording.launched_ns - _CLOCK_SLACK_NS
        if not begin_ns <= message.stamp_ns <= message.received_ns + _CLOCK_SLACK_NS:
            return Cause(
                "the source timestamps are not the times of publishing: one lies "
                + ("before the launch" if message.stamp_ns < begin_ns else "after its arrival"),
                _HINT,
                _arrival(recording, message),
            )
    # What was published before the match (transient local) arrives all at once.
    begin_ns = recording.matched_ns or recording.launched_ns
    live = [message for message in messages if message.stamp_ns >= begin_ns]
    return _why_arrivals_differ(recording, live) if len(live) > _FEWEST else None


def _why_arrivals_differ(recording: Recording, live: Sequence[Message]) -> Cause | None:
    usual_s = median(map(_way_s, live))
    # The first message of a publisher waits for its match. What holds up the middleware need not
    # show at the same moment in what the machine took.
    late = [
        item
        for item in live
        if item.sequence != 1
        and abs(_way_s(item) - usual_s)
        > _ABSOLUTE_S
        + recording.stolen_s(item.stamp_ns - _AROUND_NS, item.received_ns + _AROUND_NS)
    ]
    if len(late) > max(_MOST_LATE, _LATE_SHARE * len(live)):
        way_s = max(map(_way_s, late)) - min(map(_way_s, live))
        return Cause(
            f"{counted(len(late), 'message')} of {len(live)} came up to {format_duration(way_s)} "
            "earlier or later than their source timestamps say, and the machine took no such "
            "time: the timestamps are not the times of publishing",
            _HINT,
            _arrival(recording, late[0]),
            disturbed=True,
        )
    arrivals_ns = sorted(message.received_ns for message in live)
    source_s = median((b.stamp_ns - a.stamp_ns) / NS for a, b in pairwise(live))
    arrival_s = median((b - a) / NS for a, b in pairwise(arrivals_ns))
    if abs(arrival_s - source_s) <= max(_RELATIVE * source_s, _ABSOLUTE_S):
        return None
    return Cause.to_repeat(
        f"messages arrive every {format_duration(arrival_s)}, but their source timestamps are "
        f"{format_duration(source_s)} apart, while the machine was busy"
    )


def _arrival(recording: Recording, message: Message) -> Evidence:
    """When a message came, by our own clock."""
    when_s = recording.since_launch_s(message.received_ns)
    return Evidence(moments=(Moment(f"a message on {message.topic} arrived", when_s),))


def _way_s(message: Message) -> float:
    return (message.received_ns - message.stamp_ns) / NS
