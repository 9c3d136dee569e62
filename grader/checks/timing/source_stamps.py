"""Whether source timestamps, which the writer gives, tell when it published its messages."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from statistics import median

from grader.diagnosis.explanation import mistaken
from grader.findings.finding import Evidence, Finding, evidence_at
from grader.findings.words import counted
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
# Middleware that stamps every message.
_STAMPING = "rmw_fastrtps_cpp"


def why_not_believed(recording: Recording, messages: Sequence[Message]) -> Finding | None:
    """Why the source timestamps, which the writer gives, do not tell when it published."""
    has_stamps = any(message.stamp_ns for message in messages)
    if not has_stamps and recording.environment.get("rmw") != _STAMPING:
        return Finding.ours("the middleware gave no source timestamps")
    for message in messages:
        if message.stamp_ns < recording.launched_ns - _CLOCK_SLACK_NS:
            when = "before the launch"
        elif message.stamp_ns > message.received_ns + _CLOCK_SLACK_NS:
            when = "after its arrival"
        else:
            continue
        seen = f"the source timestamps are not the times of publishing: one lies {when}"
        return mistaken("other_clock", seen, _arrival(recording, message))
    # What was published before the match (transient local) arrives all at once.
    begin_ns = recording.matched_ns or recording.launched_ns
    live = [message for message in messages if message.stamp_ns >= begin_ns]
    if len(live) <= _FEWEST:
        return None
    return _why_some_differ(recording, live) or _why_rhythms_differ(live)


def _why_some_differ(recording: Recording, live: Sequence[Message]) -> Finding | None:
    """Why too many messages arrived much sooner or later after their stamp than most."""
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
    if len(late) <= max(_MOST_LATE, _LATE_SHARE * len(live)):
        return None
    way_s = max(map(_way_s, late)) - min(map(_way_s, live))
    return mistaken(
        "other_clock",
        f"{counted(len(late), 'message')} of {len(live)} came up to {format_duration(way_s)} "
        "earlier or later than their source timestamps say, and the machine took no such time: "
        "the timestamps are not the times of publishing",
        _arrival(recording, late[0]),
    ).doubted()


def _why_rhythms_differ(live: Sequence[Message]) -> Finding | None:
    """Why messages arrive in another rhythm than that of their stamps, although none was late."""
    arrivals_ns = sorted(message.received_ns for message in live)
    source_s = median((b.stamp_ns - a.stamp_ns) / NS for a, b in pairwise(live))
    arrival_s = median((b - a) / NS for a, b in pairwise(arrivals_ns))
    if abs(arrival_s - source_s) <= max(_RELATIVE * source_s, _ABSOLUTE_S):
        return None
    return Finding.undecided(
        f"messages arrive every {format_duration(arrival_s)}, but their source timestamps are "
        f"{format_duration(source_s)} apart, while the machine was busy"
    )


def _arrival(recording: Recording, message: Message) -> Evidence:
    return evidence_at(recording, f"a message on {message.topic} arrived", message.received_ns)


def _way_s(message: Message) -> float:
    return (message.received_ns - message.stamp_ns) / NS
