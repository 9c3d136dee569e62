"""Why messages of the robot do not reach a subscription of the student's, as the graph tells."""

from __future__ import annotations

import math
from dataclasses import replace

from grader.checks.finding import Evidence
from grader.checks.first_seen import endpoints_seen
from grader.checks.qos import compatibility
from grader.checks.wording import code, codes, listing
from grader.diagnosis.cause import Cause
from grader.diagnosis.destroyed_endpoint import why_unsubscribed
from grader.diagnosis.no_endpoint import why_no_endpoint
from grader.diagnosis.process.process_exit import why_ended
from grader.diagnosis.type_confusion import explain
from grader.recording.model import Endpoint, Kind, Owner, Recording

# Policies that promise something in time, which a publisher without them does not.
_PROMISES = ("deadline", "liveliness")


def why_not_delivered(recording: Recording, topic: str) -> Cause | None:
    """Why no message on a topic can have reached the student, or None if it must have."""
    cause = why_no_endpoint(recording, Kind.SUBSCRIPTION, topic)
    if cause is not None:
        return cause
    subscriptions = recording.student_endpoints(Kind.SUBSCRIPTION, topic)
    publishers = [
        item
        for item in recording.endpoints
        if item.owner is Owner.PROBE and item.kind is Kind.PUBLISHER and item.topic == topic
    ]
    seen = Evidence(moments=endpoints_seen(recording, subscriptions))
    cause = _other_type(topic, subscriptions, publishers, seen) or _refused(
        topic, subscriptions, publishers, seen
    )
    if cause is not None:
        return cause
    carried = recording.carried(topic)
    if carried and any(
        (item.vanished_ns or math.inf) > carried[0].stamp_ns for item in subscriptions
    ):
        return None
    return (
        why_ended(recording)
        or why_unsubscribed(recording, topic, "nothing was sent while it was there")
        or Cause.to_repeat(f"nothing was sent on {code(topic)}, so there was nothing to receive")
    )


def why_not_sent(recording: Recording, topic: str) -> Cause:
    """Why a stimulus published nothing: no subscription of the student's could get it, or ours."""
    return why_not_delivered(recording, topic) or Cause.to_repeat(
        f"nothing was sent on {code(topic)}"
    )


def why_no_history(recording: Recording, topic: str, seen: str) -> Cause | None:
    """Why the student does not get what the probe published before the launch.

    Returns:
        The policy that stands against it, or None if there is none.
    """
    for item in recording.student_endpoints(Kind.SUBSCRIPTION, topic):
        for policy, needed in (("durability", "transient_local"), ("reliability", "reliable")):
            found = getattr(item.qos, policy)
            if found in (needed, "unknown"):
                continue
            offered = [
                one.qos
                for one in recording.endpoints
                if one.owner is Owner.PROBE and one.kind is Kind.PUBLISHER and one.topic == topic
            ]
            return Cause(
                f"{seen}: the messages were published before the subscription was there, and it "
                f"requests {policy} {found}. It matches the publisher, but gets only what is "
                "published from then on",
                "A late joiner gets what a transient_local publisher has kept only if it asks for "
                "it: give create_subscription a QoSProfile with "
                "durability=DurabilityPolicy.TRANSIENT_LOCAL and "
                "reliability=ReliabilityPolicy.RELIABLE.",
                Evidence(
                    moments=endpoints_seen(recording, (item,)),
                    tables=tuple(
                        compatibility.compatibility_table(qos, item.qos) for qos in offered[:1]
                    ),
                ),
            )
    return None


def _other_type(
    topic: str,
    subscriptions: tuple[Endpoint, ...],
    publishers: list[Endpoint],
    evidence: Evidence,
) -> Cause | None:
    sent = sorted({item.type for item in publishers})
    wanted = sorted({item.type for item in subscriptions})
    if not sent or set(sent) & set(wanted):
        return None
    explanation = explain(sent[0], wanted[0])
    package, _, short = sent[0].split("/")
    return Cause(
        f"its callback is never called: {code(topic)} carries {codes(sent)}, but the subscription "
        f"is to {codes(wanted)}" + (f" ({explanation})" if explanation else ""),
        "A publisher and a subscription meet only if their types are the same: "
        f"`from {package}.msg import {short}`.",
        evidence,
    )


def _refused(
    topic: str,
    subscriptions: tuple[Endpoint, ...],
    publishers: list[Endpoint],
    evidence: Evidence,
) -> Cause | None:
    """Every subscription refuses every publisher, each by a policy."""
    reasons = [
        compatibility.refusals(offered=publisher.qos, requested=subscription.qos)
        for subscription in subscriptions
        for publisher in publishers
    ]
    if not reasons or not all(reasons):
        return None
    rule = "A subscription receives nothing from a publisher that offers less than it requests."
    promises = [word for word in _PROMISES if any(item.startswith(word) for item in reasons[0])]
    return Cause(
        f"its callback is never called: the subscription's QoS does not match the publisher on "
        f"{code(topic)} ({', '.join(reasons[0])})",
        f"{rule} Leave {listing(map(code, promises))} out of the subscription's QoSProfile."
        if promises
        else f"{rule} A number as QoS, such as 10, matches every publisher that is reliable; "
        "qos_profile_sensor_data matches every one.",
        replace(
            evidence,
            tables=(
                compatibility.compatibility_table(
                    offered=publishers[0].qos, requested=subscriptions[0].qos
                ),
            ),
        ),
    )
