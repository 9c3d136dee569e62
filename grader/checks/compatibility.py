"""The rule "requested against offered": whether a subscription matches a publisher.

https://docs.ros.org/en/jazzy/Concepts/Intermediate/About-Quality-of-Service-Settings.html
"""

from __future__ import annotations

from grader.assignment.quantity import format_duration
from grader.recording.model import Qos

# Weaker first: an offer must not be weaker than the request.
STRENGTH = {
    "reliability": ("best_effort", "reliable"),
    "durability": ("volatile", "transient_local"),
    "liveliness": ("automatic", "manual_by_topic"),
}


def refusals(offered: Qos, requested: Qos) -> tuple[str, ...]:
    """Every policy by which a subscription refuses a publisher, in words; none if they match.

    A policy that is unknown on either side refuses nothing.
    """
    found = []
    for policy, words in STRENGTH.items():
        offer, request = getattr(offered, policy), getattr(requested, policy)
        if offer in words and request in words and words.index(offer) < words.index(request):
            found.append(f"{policy} {offer} offered, {request} requested")
    for policy, offer_s, request_s in (
        ("deadline", offered.deadline_s, requested.deadline_s),
        ("liveliness lease", offered.liveliness_lease_s, requested.liveliness_lease_s),
    ):
        if request_s is not None and (offer_s is None or offer_s > request_s):
            found.append(
                f"{policy} {duration_words(offer_s)} offered, {duration_words(request_s)} requested"
            )
    return tuple(found)


def duration_words(seconds: float | None) -> str:
    """Write a QoS duration; None is infinite."""
    return "infinite" if seconds is None else format_duration(seconds)
