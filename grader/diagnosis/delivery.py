"""Why messages of the robot do not reach a subscription of the student's, as the graph tells."""

from __future__ import annotations

import math
from dataclasses import dataclass

from grader.checks.finding import Evidence
from grader.checks.first_seen import endpoints_seen
from grader.checks.wording import code, codes, listing
from grader.diagnosis.cause import Cause
from grader.diagnosis.destroyed_endpoint import why_unsubscribed
from grader.diagnosis.explanation import Symptom, explain, explanation
from grader.diagnosis.no_endpoint import why_no_endpoint
from grader.diagnosis.process.process_exit import why_ended
from grader.diagnosis.type_confusion import OtherType
from grader.measure import compatibility
from grader.recording.model import Endpoint, Kind, Owner, Recording

# Policies that promise something in time, which a publisher without them does not.
_PROMISES = ("deadline", "liveliness")


@dataclass(frozen=True)
class NotDelivered(Symptom[Cause]):
    """A node does not receive the messages of a topic."""

    recording: Recording
    topic: str

    @property
    def subscriptions(self) -> tuple[Endpoint, ...]:
        """The student's subscriptions to the topic."""
        return self.recording.student_endpoints(Kind.SUBSCRIPTION, self.topic)

    @property
    def publishers(self) -> list[Endpoint]:
        """The probe's publishers on the topic."""
        return [
            item
            for item in self.recording.endpoints
            if item.owner is Owner.PROBE
            and item.kind is Kind.PUBLISHER
            and item.topic == self.topic
        ]

    @property
    def carried(self) -> bool:
        """Whether something was sent while a subscription was there."""
        carried = self.recording.carried(self.topic)
        return bool(carried) and any(
            (item.vanished_ns or math.inf) > carried[0].stamp_ns for item in self.subscriptions
        )


def why_not_delivered(recording: Recording, topic: str) -> Cause | None:
    """Why no message on a topic can have reached the student, or None if it must have."""
    return explain(NotDelivered(recording, topic))


@explanation(NotDelivered)
def no_subscription(symptom: NotDelivered) -> Cause | None:
    """The node has no subscription to the topic."""
    return why_no_endpoint(symptom.recording, Kind.SUBSCRIPTION, symptom.topic)


@explanation(NotDelivered)
def other_type(symptom: NotDelivered) -> Cause | None:
    """The subscription has another message type than the publisher."""
    sent = sorted({item.type for item in symptom.publishers})
    wanted = sorted({item.type for item in symptom.subscriptions})
    if not sent or set(sent) & set(wanted):
        return None
    confusion = explain(OtherType(sent[0], wanted[0]))
    package, _, short = sent[0].split("/")
    return Cause(
        f"its callback is never called: {code(symptom.topic)} carries {codes(sent)}, but the "
        f"subscription is to {codes(wanted)}" + (f" ({confusion})" if confusion else ""),
        "A publisher and a subscription meet only if their types are the same: "
        f"`from {package}.msg import {short}`.",
        Evidence(moments=endpoints_seen(symptom.recording, symptom.subscriptions)),
    )


@explanation(NotDelivered)
def incompatible_qos(symptom: NotDelivered) -> Cause | None:
    """The subscription requests more (reliability, durability, deadline) than is offered."""
    subscriptions, publishers = symptom.subscriptions, symptom.publishers
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
        f"{code(symptom.topic)} ({', '.join(reasons[0])})",
        f"{rule} Leave {listing(map(code, promises))} out of the subscription's QoSProfile."
        if promises
        else f"{rule} A number as QoS, such as 10, matches every publisher that is reliable; "
        "qos_profile_sensor_data matches every one.",
        Evidence(
            moments=endpoints_seen(symptom.recording, subscriptions),
            tables=(
                compatibility.compatibility_table(
                    offered=publishers[0].qos, requested=subscriptions[0].qos
                ),
            ),
        ),
    )


@explanation(NotDelivered)
def process_ended(symptom: NotDelivered) -> Cause | None:
    """The process ended before anything was sent to it."""
    return None if symptom.carried else why_ended(symptom.recording)


@explanation(NotDelivered)
def subscription_destroyed(symptom: NotDelivered) -> Cause | None:
    """The program destroyed its subscription before anything was sent."""
    if symptom.carried:
        return None
    seen = "nothing was sent while it was there"
    return why_unsubscribed(symptom.recording, symptom.topic, seen)


@explanation(NotDelivered, general=True)
def nothing_sent(symptom: NotDelivered) -> Cause | None:
    """Nothing was sent; an error, and never a lost point."""
    if symptom.carried:
        return None
    return Cause.to_repeat(
        f"nothing was sent on {code(symptom.topic)}, so there was nothing to receive"
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
