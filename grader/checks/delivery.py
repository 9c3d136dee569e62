"""Why messages of the robot do not reach a subscription of the student's, as the graph tells."""

from __future__ import annotations

from grader.checks import compatibility
from grader.checks.cause import Cause
from grader.checks.death import cause_of_death, dead
from grader.checks.finding import Evidence, Table
from grader.checks.topic_absence import why_no_endpoint
from grader.checks.type_confusion import explain
from grader.checks.wording import code, codes
from grader.recording.model import Endpoint, Kind, Owner, Recording


def why_not_delivered(recording: Recording, topic: str) -> Cause | None:
    """Why no message on a topic can have reached the student, or None if it must have.

    Args:
        recording: A run in which the cell publishes on the topic.
        topic: Fully qualified topic name.
    """
    cause = why_no_endpoint(recording, Kind.SUBSCRIPTION, topic)
    if cause is not None:
        return cause
    subscriptions = recording.student_endpoints(Kind.SUBSCRIPTION, topic)
    publishers = [
        item
        for item in recording.endpoints
        if item.owner is Owner.PROBE and item.kind is Kind.PUBLISHER and item.topic == topic
    ]
    cause = _other_type(topic, subscriptions, publishers) or _refused(
        topic, subscriptions, publishers
    )
    if cause is not None:
        return cause
    if recording.on(topic):
        return _gone(recording, topic, subscriptions)
    ended = dead(recording)
    if ended:
        return cause_of_death(recording, ended[0])
    return Cause(
        f"nothing was sent on {code(topic)}, so there was nothing to receive",
        ours=True,
        disturbed=True,
    )


def _other_type(
    topic: str, subscriptions: tuple[Endpoint, ...], publishers: list[Endpoint]
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
    )


def _refused(
    topic: str, subscriptions: tuple[Endpoint, ...], publishers: list[Endpoint]
) -> Cause | None:
    """Every subscription refuses every publisher, each by a policy."""
    reasons = [
        compatibility.refusals(offered=publisher.qos, requested=subscription.qos)
        for subscription in subscriptions
        for publisher in publishers
    ]
    if not reasons or not all(reasons):
        return None
    rows = tuple((reason.partition(" ")[0], reason.partition(" ")[2]) for reason in reasons[0])
    return Cause(
        f"its callback is never called: the subscription's QoS does not match the publisher on "
        f"{code(topic)} ({', '.join(reasons[0])})",
        "A subscription receives nothing from a publisher that offers less than it requests. A "
        "number as QoS, such as 10, matches every publisher that is reliable; "
        "qos_profile_sensor_data matches every one.",
        Evidence(tables=(Table("Requested against offered", ("policy", "why"), rows),)),
    )


def _gone(recording: Recording, topic: str, subscriptions: tuple[Endpoint, ...]) -> Cause | None:
    """Every subscription vanished before the first message was sent."""
    first_ns = recording.on(topic)[0].stamp_ns
    ends = [item.vanished_ns for item in subscriptions]
    if any(end is None or end > first_ns for end in ends):
        return None
    ended = dead(recording)
    if ended:
        return cause_of_death(recording, ended[0])
    return Cause(
        f"the subscription to {code(topic)} vanished before the first message came",
        "Keep the node and its subscription alive while rclpy.spin(node) runs: no "
        "destroy_subscription() and no destroy_node() before.",
    )
