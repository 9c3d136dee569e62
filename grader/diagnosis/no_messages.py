"""Why no message, or too few, came on a topic, or none reached a subscription of the student's."""

from __future__ import annotations

import math
from dataclasses import dataclass

from grader.diagnosis.destroyed_endpoint import why_unpublished, why_unsubscribed
from grader.diagnosis.explanation import Symptom, cause_of, explain, explanation, mistaken, remedy
from grader.diagnosis.no_endpoint import why_no_endpoint
from grader.diagnosis.process.not_called import (
    NotCalled,
    blocked_executor,
    callback_raised,
    held_up_below,
    left_s,
    no_cpu_time,
)
from grader.diagnosis.process.process_exit import process_ended, why_ended
from grader.findings.finding import (
    Evidence,
    Finding,
    Moment,
    endpoints_seen,
    evidence_at,
    first_seen,
)
from grader.findings.words import code, codes, counted, type_in_code
from grader.measure.compatibility import compatibility_table, refusals, sides
from grader.measure.declarations import timers, was_held_up
from grader.recording.model import NS, Endpoint, Kind, Owner, Qos, Recording
from grader.recording.submission import CPP
from grader.spec.unit import format_duration

# Without what the host took: in so long a node answers what it was asked.
_OWN_S = 2.0
# As rclcpp_lifecycle logs it, with the topic in quotes.
_INACTIVE = "but the publisher is not activated"


@dataclass(frozen=True)
class OnTopic(Symptom[Finding]):
    """Something is missing on a topic, as the student's endpoints of a kind have it."""

    recording: Recording
    topic: str
    kind = Kind.PUBLISHER

    @property
    def own(self) -> tuple[Endpoint, ...]:
        """The student's endpoints on the topic."""
        return self.recording.student_endpoints(self.kind, self.topic)

    @property
    def nodes(self) -> set[str]:
        """The nodes that have them."""
        return {item.node for item in self.own}

    @property
    def others(self) -> list[Endpoint]:
        """The probe's endpoints at the other end."""
        return [
            item
            for item in self.recording.endpoints
            if item.owner is Owner.PROBE and item.kind is not self.kind and item.topic == self.topic
        ]

    @property
    def pairs(self) -> list[tuple[Qos, Qos]]:
        """The QoS that is offered and the one that is requested, of each two that could match."""
        return [sides(self.kind, own.qos, other.qos) for own in self.own for other in self.others]

    @property
    def refused(self) -> list[tuple[Qos, Qos]]:
        """Those of them that do not match."""
        return [pair for pair in self.pairs if refusals(*pair)]

    @property
    def seen(self) -> str:
        """The symptom in words."""
        return f"no message on {code(self.topic)}"

    @property
    def moments(self) -> tuple[Moment, ...]:
        """When the student's endpoints appeared."""
        return endpoints_seen(self.recording, self.own)

    @property
    def begin_ns(self) -> int:
        """When the observation of the topic began."""
        return self.recording.matched_ns or self.recording.launched_ns

    @property
    def asked(self) -> tuple[str, ...]:
        """Topics that the probe publishes on and that this one answers, as the assignment says."""
        answers = self.recording.answers
        return tuple(
            name for name in self.recording.sent if answers.get(name, self.topic) == self.topic
        )

    @property
    def since_ns(self) -> int:
        """When the last message came, or the first one was sent that should be answered."""
        messages = self.recording.on(self.topic)
        if messages:
            return messages[-1].stamp_ns
        sent = [self.recording.sent[name] for name in self.asked]
        first_ns = [messages[0].stamp_ns for messages in sent if messages]
        return min(first_ns, default=self.recording.launched_ns)

    @property
    def watched_s(self) -> float:
        """How long the topic was observed."""
        return (self.recording.stop_ns - self.begin_ns) / NS


@dataclass(frozen=True)
class NoMessages(OnTopic, NotCalled):
    """No message came on a topic."""

    @property
    def excuse(self) -> Finding | None:
        """The machine's doing, if it took so much that nothing is proven."""
        return self.starved(self.begin_ns, self.recording.stop_ns)

    def guilty(self) -> Finding | None:
        """The same, or no answer in a time of its own in which a node answers."""
        guilty = super().guilty()
        is_asked = self.since_ns > self.recording.launched_ns
        had_time = left_s(self.recording, self.since_ns, self.recording.stop_ns) >= _OWN_S
        if guilty is None and is_asked and had_time:
            return callback_raised(self) or no_answer(self)
        return guilty


@dataclass(frozen=True)
class FewMessages(OnTopic, NotCalled):
    """Too few messages came on a topic."""

    needed: int

    @property
    def needs_spin(self) -> bool:
        """Whether it has a timer: a program may publish without one, and needs no spin then."""
        return bool(timers(self.recording))

    @property
    def seen(self) -> str:
        """The symptom in words."""
        number = counted(len(self.recording.on(self.topic)), "message")
        return f"{number} on {code(self.topic)} in {format_duration(self.watched_s)}"

    @property
    def moments(self) -> tuple[Moment, ...]:
        """When the first message came."""
        return first_seen(self.recording, self.recording.on(self.topic))

    @property
    def excuse(self) -> Finding | None:
        """The machine's doing, if without its delays the process may have published enough."""
        number, span_ns = (
            len(self.recording.on(self.topic)),
            (self.begin_ns, self.recording.stop_ns),
        )
        return held_up_below(self.recording, self.seen, number, self.needed, span_ns)


@dataclass(frozen=True)
class NotDelivered(OnTopic):
    """A node does not receive the messages of a topic."""

    kind = Kind.SUBSCRIPTION

    @property
    def seen(self) -> str:
        """The symptom in words."""
        return "its callback is never called"


def seconds_hint(period_s: float = 0.3) -> str:
    """What a timer takes as its period."""
    return remedy("seconds", number=f"{period_s:g}", period=format_duration(period_s))


def why_silent(recording: Recording, topic: str) -> Finding:
    """Why nothing was recorded on a topic."""
    return cause_of(NoMessages(recording, topic))


def why_few(recording: Recording, topic: str, needed: int) -> Finding:
    """Why fewer messages than needed were recorded on a topic."""
    if not recording.on(topic):
        return why_silent(recording, topic)
    return cause_of(FewMessages(recording, topic, needed))


def why_not_delivered(recording: Recording, topic: str) -> Finding | None:
    """Why no message on a topic can have reached the student, or None if it must have."""
    return explain(NotDelivered(recording, topic))


def why_not_sent(recording: Recording, topic: str) -> Finding:
    """Why a stimulus published nothing; without another reason the run should be repeated."""
    return why_not_delivered(recording, topic) or Finding.undecided(
        f"nothing was sent on {code(topic)}"
    )


def why_unreadable(recording: Recording, topic: str) -> Finding | None:
    """Why messages on a topic could not be read, or None where all could."""
    number = recording.unreadable.get(topic, 0)
    if not number:
        return None
    return mistaken(
        "unreadable_message",
        f"{counted(number, 'message')} on {code(topic)} cannot be read: the bytes that were "
        "published are not a message of its type",
        Evidence(
            moments=endpoints_seen(recording, recording.student_endpoints(Kind.PUBLISHER, topic))
        ),
    )


@explanation(NoMessages, only=CPP)
def not_activated(symptom: NoMessages) -> Finding | None:
    """The publisher of a lifecycle node was never activated, as the log says."""
    lines = [line.text for line in symptom.recording.log if _INACTIVE in line.text]
    said = tuple(line for line in lines if f"'{symptom.topic}'" in line)
    if not said:
        return None
    return mistaken(
        "not_activated",
        f"{symptom.seen}: the log says that its publisher is not activated",
        Evidence(moments=symptom.moments, log=said[:1]),
    )


@explanation(NoMessages, NotDelivered)
def no_endpoint(symptom: OnTopic) -> Finding | None:
    """The node has no publisher, or no subscription, on the topic."""
    return why_no_endpoint(symptom.recording, symptom.kind, symptom.topic)


@explanation(NoMessages, NotDelivered, concept="interfaces")
def other_type(symptom: OnTopic) -> Finding | None:
    """The publisher and the subscription have different message types or definitions."""
    own_types = sorted({item.type for item in symptom.own})
    right_types = sorted({item.type for item in symptom.others})
    misdefined = symptom.recording.misdefined(symptom.topic) and symptom.kind is Kind.PUBLISHER
    if not own_types or not right_types:
        return None
    if not misdefined and set(own_types) & set(right_types):
        return None
    other = "with another definition" if misdefined else f"not {codes(right_types, last='or')}"
    return mistaken(
        "other_type",
        f"{symptom.seen}: the {symptom.kind.value} on {code(symptom.topic)} has the type "
        f"{codes(own_types)}, {other}",
        Evidence(moments=symptom.moments),
        type=code(type_in_code(right_types[0])),
    )


@explanation(NoMessages, FewMessages, before=(process_ended,))
def unreadable(symptom: OnTopic) -> Finding | None:
    """The program publishes bytes that are not a message of this type."""
    return why_unreadable(symptom.recording, symptom.topic)


@explanation(NoMessages, NotDelivered, concept="qos")
def incompatible_qos(symptom: OnTopic) -> Finding | None:
    """The publisher's QoS offers less (reliability, durability, deadline) than requested."""
    return why_refused(symptom) if symptom.pairs == symptom.refused else None


def why_unheard(recording: Recording) -> Finding | None:
    """Why a subscription of the student's gets nothing, by its QoS; None if each may get some."""
    topics = {one.topic for one in recording.student_endpoints(Kind.SUBSCRIPTION)}
    causes = (incompatible_qos(NotDelivered(recording, topic)) for topic in sorted(topics))
    cause = next(filter(None, causes), None)
    return cause and cause.after("a subscription of the node gets nothing")


def why_refused(symptom: OnTopic) -> Finding | None:
    """The cause if the QoS of an endpoint of the student's refuses another one, or is refused."""
    if not symptom.refused:
        return None
    other = "its reader" if symptom.kind is Kind.PUBLISHER else "the publisher"
    pair = symptom.refused[0]
    return mistaken(
        "refused_qos",
        f"{symptom.seen}: the {symptom.kind.value}'s QoS does not match {other} on "
        f"{code(symptom.topic)} ({', '.join(refusals(*pair))})",
        Evidence(
            moments=endpoints_seen(symptom.recording, symptom.own),
            tables=(compatibility_table(*pair),),
        ),
    )


@explanation(NotDelivered, general=True)
def nothing_sent(symptom: NotDelivered) -> Finding | None:
    """The process ended or destroyed its subscription before a message was sent."""
    recording, topic = symptom.recording, symptom.topic
    messages = recording.carried(topic)
    gone_ns = max((item.vanished_ns or math.inf for item in symptom.own), default=0)
    if messages and gone_ns > messages[0].stamp_ns:
        return None
    return (
        why_ended(recording)
        or why_unsubscribed(recording, topic, "nothing was sent while it was there")
        or Finding.undecided(f"nothing was sent on {code(topic)}, so there was nothing to receive")
    )


@explanation(NoMessages, before=(process_ended,))
def never_matched(symptom: NoMessages) -> Finding | None:
    """Because the machine was busy, the publisher and the probe did not discover each other."""
    held = [one.data for one in symptom.recording.declared("held")]
    is_unmatched = any(
        data.get("topic") == symptom.topic and data.get("matched") is False for data in held
    )
    if not is_unmatched or not was_held_up(symptom.recording):
        return None
    return Finding.undecided(
        f"the subscription of rosgrade did not match the publisher on {code(symptom.topic)} in "
        "time, so a message could be lost"
    )


@explanation(NoMessages, after=(process_ended,))
@explanation(FewMessages, after=(no_cpu_time,), before=(callback_raised,))
def publisher_destroyed(symptom: OnTopic) -> Finding | None:
    """The program destroyed its publisher."""
    return why_unpublished(symptom.recording, symptom.topic, symptom.seen)


@explanation(NoMessages)
def nothing_to_answer(symptom: NoMessages) -> Finding | None:
    """The messages that the node should answer did not reach it."""
    causes = [why_not_delivered(symptom.recording, name) for name in symptom.asked]
    if not causes or causes[0] is None or None in causes:
        return None
    return causes[0].after(
        f"{symptom.seen}, because the messages that the node should answer, on "
        f"{code(symptom.asked[0])}, never reached it"
    )


@explanation(NoMessages, after=(blocked_executor,))
def no_answer(symptom: NoMessages) -> Finding | None:
    """The subscription's callback gets a message, but does not publish."""
    recording = symptom.recording
    for name in symptom.asked:
        sent = recording.sent[name]
        if sent:
            messages = f"{counted(len(sent), 'message')} on {code(name)}"
            seen = f"{symptom.seen}, although {messages} reached the node"
            evidence = evidence_at(recording, f"sent on {name}", sent[0].stamp_ns)
            return symptom.placed(mistaken("no_answer", seen, evidence))
    return None
