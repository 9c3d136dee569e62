"""Why a transform is not there, or is not as it should be."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

from grader.diagnosis.destroyed_endpoint import why_unpublished
from grader.diagnosis.explanation import Symptom, explanation, mistaken, remedy
from grader.diagnosis.no_endpoint import why_no_endpoint
from grader.diagnosis.no_messages import NoMessages, never_matched, why_silent
from grader.diagnosis.process.process_exit import (
    NotDone,
    ended_early,
    process_ended,
    why_ended,
)
from grader.findings.finding import Evidence, Finding, endpoints_seen, evidence_at
from grader.findings.words import code, codes, counted
from grader.measure import declarations
from grader.measure.compatibility import refusals
from grader.measure.transforms import Sent, is_static, sent
from grader.recording.model import NS, Kind, Qos, Recording
from grader.spec.nearest_name import nearest
from grader.spec.unit import format_duration

# A stamp may be that of the data that a transform is made of, or of the near future.
_STAMP_S = 1.0


@dataclass(frozen=True)
class NoTransform(NotDone, concept="frames"):
    """A transform between two frames is not on its topic."""

    topic: str
    parent: str
    child: str
    only_failures = True

    @cached_property
    def there(self) -> list[Sent]:
        """Every transform of the run."""
        return list(sent(self.recording, self.recording.messages))

    @cached_property
    def wanted(self) -> list[Sent]:
        """Those between the two frames, on the topic."""
        names = (self.topic, self.parent, self.child)
        return [it for it in self.there if (it.message.topic, it.parent, it.child) == names]

    @cached_property
    def edges(self) -> dict[tuple[str, str], Sent]:
        """Parent and child -> the first transform between them."""
        return {(one.parent, one.child): one for one in reversed(self.there)}

    @property
    def hint(self) -> str:
        """What publishes on the topic as tf2 requests it."""
        return remedy("not_static" if is_static(self.topic) else "not_broadcast")

    def instead(self, one: Sent | None, why: str, hint: str = "") -> Finding | None:
        """Another transform is there, if it is."""
        if one is None:
            return None
        seen = f"{edge(one.parent, one.child)} on {code(one.message.topic)} {why}"
        hint = hint or remedy("other_frames", parent=self.parent, child=self.child)
        return Finding(seen, hint, when_sent(self.recording, one, "sent"))


@dataclass(frozen=True)
class BadTransform(Symptom[Finding], concept="frames"):
    """A transform that may be of no use to tf2.

    Attributes:
        known: Stamps of messages that it may be made of.
    """

    recording: Recording
    one: Sent
    known: Collection[int | None] = ()


def edge(parent: str, child: str) -> str:
    """A transform by its frames."""
    return f"{code(parent)} → {code(child)}"


def when_sent(recording: Recording, one: Sent, what: str) -> Evidence:
    """When a transform was published."""
    return evidence_at(recording, f"{one.parent} → {one.child} {what}", one.message.stamp_ns)


@explanation(NoTransform, after=(process_ended,))
def refused_by_tf2(symptom: NoTransform) -> Finding | None:
    """The publisher's QoS is not what tf2 requests: on /tf_static transient_local."""
    own = symptom.recording.student_endpoints(Kind.PUBLISHER, symptom.topic)
    requested = Qos("reliable", "transient_local" if is_static(symptom.topic) else "volatile")
    refused = [", ".join(refusals(one.qos, requested)) for one in own]
    if not any(refused):
        return None
    seen = f"tf2 gets nothing from the publisher on {code(symptom.topic)} ({max(refused)})"
    evidence = Evidence(moments=endpoints_seen(symptom.recording, own))
    return Finding(seen, symptom.hint, evidence)


@explanation(NoTransform)
def overwritten(symptom: NoTransform) -> Finding | None:
    """Late joiners miss it on /tf_static: its publisher keeps only messages that came later."""
    recording, topic = symptom.recording, symptom.topic
    depth = _depth_of_only_publisher(recording, topic)
    if not depth or not is_static(topic) or not symptom.wanted:
        return None
    kept = recording.on(topic)[-depth:]
    if symptom.wanted[-1].message in kept:
        return None
    return mistaken(
        "overwritten",
        "a node that starts later does not get it: the publisher keeps "
        f"{counted(len(kept), 'message')}, and published others after it",
        when_sent(recording, symptom.wanted[-1], "sent"),
    )


def _depth_of_only_publisher(recording: Recording, topic: str) -> int | None:
    """How many messages the one publisher on a topic keeps; None of several, or for all."""
    queues = declarations.queues(recording, Kind.PUBLISHER, topic)
    ends = [one for one in recording.endpoints if one.topic == topic]
    publishers = [one for one in ends if one.kind is Kind.PUBLISHER]
    if len(queues) != 1 or len(publishers) != 1 or queues[0].history != "keep_last":
        return None
    return queues[0].depth


@explanation(NoTransform)
def other_topic(symptom: NoTransform) -> Finding | None:
    """It is on /tf instead of /tf_static, or the other way round."""
    found = symptom.edges.get((symptom.parent, symptom.child))
    return symptom.instead(found, f"instead of {code(symptom.topic)}", symptom.hint)


@explanation(NoTransform)
def exchanged_frames(symptom: NoTransform) -> Finding | None:
    """Parent and child are exchanged."""
    found = symptom.edges.get((symptom.child, symptom.parent))
    return symptom.instead(found, "is the other way round: parent and child are exchanged")


@explanation(NoTransform)
def no_transform_at_all(symptom: NoTransform) -> Finding | None:
    """Nothing is published on the topic, or only by others, such as the simulated robot."""
    recording, topic = symptom.recording, symptom.topic
    cause = why_no_endpoint(recording, Kind.PUBLISHER, topic)
    cause = cause or never_matched(NoMessages(recording, topic))
    if cause is not None or recording.on(topic):
        return cause
    return why_silent(recording, topic)


@explanation(NoTransform)
def other_frame(symptom: NoTransform) -> Finding | None:
    """The frame has another parent, or a name is misspelt."""
    for transform in symptom.there:
        if transform.child == symptom.child:
            return symptom.instead(transform, "is there instead")
    by_names = {" ".join(frames): one for frames, one in symptom.edges.items()}
    match = nearest(f"{symptom.parent} {symptom.child}", by_names)
    return symptom.instead(by_names[match], "is there instead") if match is not None else None


@explanation(NoTransform, general=True)
def other_transforms_only(symptom: NoTransform) -> Finding | None:
    """Only transforms of other frames are published."""
    first = next(iter(symptom.there), None)
    others = codes(child for _, child in symptom.edges)
    return symptom.instead(first, f"and no other than those of {others} are published")


@explanation(BadTransform)
def no_quaternion(symptom: BadTransform) -> Finding | None:
    """The quaternion does not have the length 1: w is not set, or all four are 0."""
    if symptom.one.is_valid:
        return None
    *axis, w = (symptom.one.value["rotation"][part] for part in "xyzw")
    numbers = ", ".join(f"{part:.4g}" for part in (*axis, w))
    clause = ": w is not set" if w in (0.0, 1.0) and any(axis) else ""
    return mistaken(
        "no_quaternion",
        f"tf2 ignores the transform, for its quaternion (x, y, z, w) = ({numbers}) does not have "
        f"the length 1{clause}",
        when_sent(symptom.recording, symptom.one, "ignored"),
    )


@explanation(BadTransform, concept="stamps")
def wrong_stamp(symptom: BadTransform) -> Finding | None:
    """The stamp is 0, always the same, or of another clock."""
    sent_ns, stamp_ns = symptom.one.message.stamp_ns, symptom.one.stamp_ns
    if is_static(symptom.one.message.topic) or stamp_ns in symptom.known:
        return None
    late_s = (sent_ns - stamp_ns) / NS
    if abs(late_s) <= _STAMP_S + symptom.recording.stolen_s(min(stamp_ns, sent_ns), sent_ns):
        return None
    off = f"{format_duration(abs(late_s))} {'before' if late_s > 0.0 else 'after'}"
    seen = f"the stamp is {off} the moment of publishing: always the same, or of another clock"
    return mistaken(
        "wrong_stamp",
        seen if stamp_ns else "the stamp is 0: it is not set",
        when_sent(symptom.recording, symptom.one, "has a wrong stamp"),
    )


def why_gone(recording: Recording, topic: str, seen: str) -> Finding | None:
    """Why no publisher on a topic stayed until the end, or None if one did."""
    destroyed = why_unpublished(recording, topic, seen)
    if destroyed is not None:
        return destroyed
    for publisher in recording.student_endpoints(Kind.PUBLISHER, topic):
        process = declarations.process_of(recording, publisher.node)
        if process is not None and not ended_early(recording, process):
            return None
    return why_ended(recording, seen)
