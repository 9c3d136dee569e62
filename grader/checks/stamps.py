"""Whether source timestamps can be believed: they come from the writer, arrivals from us."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from statistics import median

from grader.assignment.unit import format_duration
from grader.checks.cause import Cause
from grader.checks.finding import Evidence, Moment
from grader.recording.model import NS, Message, Recording

_RELATIVE = 0.20
_ABSOLUTE_S = 0.020
_CLOCK_SLACK_NS = 50_000_000
# Fewer arrivals have no meaningful median.
_FEWEST = 3
_HINT = "Publish when the time has come, and leave the clock of the process alone."


def why_not_believed(recording: Recording, messages: Sequence[Message]) -> Cause | None:
    """Why the source timestamps of these messages do not tell when they were published.

    Args:
        recording: Where they were recorded.
        messages: In the order of their source timestamps.

    Returns:
        A cause, an error where the host's disturbance may explain the difference, or None.
    """
    if not any(message.stamp_ns for message in messages):
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
    return _arrivals_differ(recording, messages)


def _arrivals_differ(recording: Recording, messages: Sequence[Message]) -> Cause | None:
    # What was published before the match (transient local) arrives all at once.
    begin_ns = recording.matched_ns or recording.launched_ns
    live = [message for message in messages if message.stamp_ns >= begin_ns]
    if len(live) <= _FEWEST:
        return None
    arrivals_ns = sorted(message.received_ns for message in live)
    source_s = median((b.stamp_ns - a.stamp_ns) / NS for a, b in pairwise(live))
    arrival_s = median((b - a) / NS for a, b in pairwise(arrivals_ns))
    beyond_s = abs(arrival_s - source_s) - max(_RELATIVE * source_s, _ABSOLUTE_S)
    if beyond_s <= 0.0:
        return None
    words = (
        f"messages arrive every {format_duration(arrival_s)}, but their source timestamps are "
        f"{format_duration(source_s)} apart"
    )
    if median(recording.taken_s(a, b) for a, b in pairwise(arrivals_ns)) >= beyond_s:
        return Cause(f"{words}, while the machine was busy", ours=True, disturbed=True)
    if not _drifts(live):
        return Cause(f"{words}: something held them up on their way", ours=True, disturbed=True)
    return Cause(
        f"{words}: the timestamps are not the times of publishing",
        _HINT,
        _arrival(recording, live[0]),
    )


def _arrival(recording: Recording, message: Message) -> Evidence:
    """When a message came, by our own clock."""
    when_s = recording.since_launch_s(message.received_ns)
    return Evidence(moments=(Moment(f"a message on {message.topic} arrived", when_s),))


def _drifts(messages: Sequence[Message]) -> bool:
    """Whether arrivals and stamps run apart, as two different rates do.

    Delivery in bursts makes single messages late, but not ever later.
    """
    half = len(messages) // 2
    first, last = messages[:half], messages[-half:]
    drift_s = abs(median(map(_latency_s, last)) - median(map(_latency_s, first)))
    apart_s = (last[0].stamp_ns - first[0].stamp_ns) / NS
    return drift_s > max(_RELATIVE * apart_s, _ABSOLUTE_S)


def _latency_s(message: Message) -> float:
    return (message.received_ns - message.stamp_ns) / NS
