"""The rule "requested against offered": whether a subscription matches a publisher.

https://docs.ros.org/en/jazzy/Concepts/Intermediate/About-Quality-of-Service-Settings.html
"""

from __future__ import annotations

from dataclasses import dataclass

from grader.findings.finding import Table
from grader.recording.model import Kind, Qos
from grader.spec.unit import format_duration

# Weaker first: an offer must not be weaker than the request.
STRENGTH = {
    "reliability": ("best_effort", "reliable"),
    "durability": ("volatile", "transient_local"),
    "liveliness": ("automatic", "manual_by_topic"),
}
_DURATIONS = {"deadline": "deadline_s", "liveliness lease": "liveliness_lease_s"}


@dataclass(frozen=True)
class Comparison:
    """One policy of a publisher and a subscription; None where it is not known if they match."""

    policy: str
    offered: str
    requested: str
    compatible: bool | None
    rule: str


def sides(kind: Kind, own: Qos, other: Qos) -> tuple[Qos, Qos]:
    """What is offered and what is requested, of an endpoint of a kind and the other end."""
    return (own, other) if kind is Kind.PUBLISHER else (other, own)


def comparisons(offered: Qos, requested: Qos) -> tuple[Comparison, ...]:
    """Compare every policy that decides whether two endpoints match."""
    found = []
    for policy, words in STRENGTH.items():
        offer, request = getattr(offered, policy), getattr(requested, policy)
        known = offer in words and request in words
        fits = words.index(offer) >= words.index(request) if known else None
        rule = f"a request for {words[1]} needs an offer of {words[1]}"
        found.append(Comparison(policy, offer, request, fits, rule))
    for policy, attribute in _DURATIONS.items():
        offer_s, request_s = getattr(offered, attribute), getattr(requested, attribute)
        fits = request_s is None or (offer_s is not None and offer_s <= request_s)
        rule = "the offer must not be longer than the request"
        shown = duration_words(offer_s), duration_words(request_s)
        found.append(Comparison(policy, *shown, fits, rule))
    return tuple(found)


def refusals(offered: Qos, requested: Qos) -> tuple[str, ...]:
    """Every policy by which a subscription refuses a publisher, in words; none if they match.

    A policy that is unknown on either side refuses nothing.
    """
    return tuple(
        f"{item.policy} {item.offered} offered, {item.requested} requested"
        for item in comparisons(offered, requested)
        if item.compatible is False
    )


def compatibility_table(offered: Qos, requested: Qos) -> Table:
    """The rule "requested against offered", policy by policy."""
    words = {True: "yes", False: "no", None: "unknown"}
    return Table(
        "Requested against offered",
        ("policy", "offered", "requested", "compatible", "rule"),
        tuple(
            (item.policy, item.offered, item.requested, words[item.compatible], item.rule)
            for item in comparisons(offered, requested)
        ),
    )


def duration_words(seconds: float | None) -> str:
    """Write a QoS duration; None is infinite."""
    return "infinite" if seconds is None else format_duration(seconds)
