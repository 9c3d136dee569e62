"""Tables of a report: two texts side by side, and QoS offered against requested."""

from __future__ import annotations

import re
from dataclasses import dataclass
from difflib import SequenceMatcher

from grader.diagnosis.no_endpoint import OWN_TOPICS
from grader.findings.finding import Comparison
from grader.measure.compatibility import STRENGTH, duration_words, refusals
from grader.recording.model import Endpoint, Kind, Owner, Qos, Recording
from grader.spec.safe_text import one_line

MOST_LINES = 200
SIGNS = {"same": "", "changed": "≠", "missing": "−", "extra": "+"}
"""Kinds of rows, each with a sign, so that colour is not needed."""
Line = list[tuple[str, bool]]
"""Pieces of a line, each with whether the other side lacks it; none where there is no line."""


@dataclass(frozen=True)
class Row:
    """Two lines beside each other, of one of the kinds in :data:`SIGNS`."""

    kind: str
    expected: Line
    observed: Line


def align(comparison: Comparison) -> list[Row]:
    """Put the lines of a comparison beside each other, those first that belong together."""
    left = [one_line(text) for text in comparison.expected[:MOST_LINES]]
    right = [one_line(text) for text in comparison.observed[:MOST_LINES]]
    rows: list[Row] = []
    for what, a1, a2, b1, b2 in SequenceMatcher(None, left, right, autojunk=False).get_opcodes():
        both = min(a2 - a1, b2 - b1)
        for one, other in zip(left[a1 : a1 + both], right[b1 : b1 + both], strict=True):
            rows.append(Row("same" if what == "equal" else "changed", *_marked(one, other)))
        rows += [Row("missing", [(text, False)], []) for text in left[a1 + both : a2]]
        rows += [Row("extra", [], [(text, False)]) for text in right[b1 + both : b2]]
    return rows


def _marked(left: str, right: str) -> tuple[Line, Line]:
    """Mark the words that differ."""
    a, b = re.findall(r"\s+|\w+|[^\w\s]", left), re.findall(r"\s+|\w+|[^\w\s]", right)
    codes = SequenceMatcher(None, a, b, autojunk=False).get_opcodes()
    return (
        [("".join(a[a1:a2]), what != "equal") for what, a1, a2, _, _ in codes if a1 < a2],
        [("".join(b[b1:b2]), what != "equal") for what, _, _, b1, b2 in codes if b1 < b2],
    )


MOST_ROWS = 40
POLICIES = ("reliability", "durability", "deadline", "liveliness")


@dataclass(frozen=True)
class Pair:
    """A publisher and a subscription on one topic, each its node or ``the grader``.

    ``cells`` are policy, what is offered and what is requested.
    """

    topic: str
    publisher: str
    subscription: str
    cells: tuple[tuple[str, str, str], ...]
    refused: frozenset[str]
    types_differ: bool


def pairs(recording: Recording) -> tuple[Pair, ...]:
    """Every publisher and subscription that could meet, each different pair once."""
    ends = [item for item in recording.endpoints if item.topic not in OWN_TOPICS]
    found = (
        _pair(publisher, subscription)
        for publisher in ends
        if publisher.kind is Kind.PUBLISHER
        for subscription in ends
        if subscription.kind is Kind.SUBSCRIPTION
        and subscription.topic == publisher.topic
        and Owner.STUDENT in (publisher.owner, subscription.owner)
    )
    return tuple(dict.fromkeys(found))[:MOST_ROWS]


def _pair(publisher: Endpoint, subscription: Endpoint) -> Pair:
    reasons = refusals(offered=publisher.qos, requested=subscription.qos)
    return Pair(
        publisher.topic,
        _whose(publisher),
        _whose(subscription),
        tuple((p, _words(publisher.qos, p), _words(subscription.qos, p)) for p in POLICIES),
        frozenset(name for name in POLICIES if any(text.startswith(name) for text in reasons)),
        publisher.type != subscription.type,
    )


def _whose(endpoint: Endpoint) -> str:
    return endpoint.node if endpoint.owner is Owner.STUDENT else "the grader"


def _words(qos: Qos, policy: str) -> str:
    if policy not in STRENGTH:
        return duration_words(qos.deadline_s)
    lease = f", {duration_words(qos.liveliness_lease_s)}" if qos.liveliness_lease_s else ""
    return f"{getattr(qos, policy)}{lease if policy == 'liveliness' else ''}"
