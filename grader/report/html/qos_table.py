"""QoS offered against requested, for every pair of endpoints of which one is the student's."""

from __future__ import annotations

from dataclasses import dataclass

from grader.diagnosis.no_endpoint import OWN_TOPICS
from grader.measure.compatibility import STRENGTH, duration_words, refusals
from grader.recording.model import Endpoint, Kind, Owner, Qos, Recording

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
