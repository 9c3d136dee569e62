"""Times of a bag that do not go together: of another computer, of a simulation, set meanwhile."""

from __future__ import annotations

import statistics
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence

from grader.findings.words import code
from grader.recording.mcap_writer import RawMessage
from grader.recording.model import NS
from grader.spec.unit import format_duration

_SAME_CLOCK_S = 2.0
"""Stamps in headers that are farther from a bag's own times come from another clock."""
_MOST_SAMPLES = 50
"""Stamps of a topic that are read: to read each message of a long bag would take minutes."""


def clocks_set_back(messages: Sequence[RawMessage]) -> Iterator[str]:
    """Topics whose times of publication go back by more than a second, each told once."""
    before_ns: dict[str, int] = {}
    told = set()
    for message in sorted(messages, key=lambda one: one.received_ns):
        back_ns = before_ns.get(message.topic, message.stamp_ns) - message.stamp_ns
        if back_ns > NS and message.topic not in told:
            told.add(message.topic)
            back = format_duration(back_ns / NS)
            yield f"the clock of {code(message.topic)} jumps back by {back}"
        before_ns[message.topic] = message.stamp_ns


def other_clocks(
    messages: Sequence[RawMessage], header_stamp_ns: Callable[[RawMessage], int | None]
) -> Iterator[str]:
    """Topics whose headers have stamps of another clock than the bag."""
    by_topic = defaultdict(list)
    for message in messages:
        by_topic[message.topic].append(message)
    for topic, on_topic in sorted(by_topic.items()):
        ages_s = [
            (message.stamp_ns - stamp_ns) / NS
            for message in on_topic[:: max(1, len(on_topic) // _MOST_SAMPLES)]
            if (stamp_ns := header_stamp_ns(message)) is not None
        ]
        off_s = statistics.median(ages_s) if ages_s else 0.0
        if abs(off_s) > _SAME_CLOCK_S:
            off = format_duration(round(abs(off_s), 1))
            way = "behind" if off_s > 0.0 else "ahead of"
            yield (
                f"the stamps in the headers of {code(topic)} are {off} {way} the times of the "
                "bag: they come from another clock, such as that of a simulation or of another "
                "computer"
            )
