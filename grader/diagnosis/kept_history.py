"""Why a late joiner did not get what a publisher should keep for it, or more."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from grader.diagnosis.destroyed_endpoint import why_unpublished
from grader.diagnosis.explanation import Symptom, explanation, mistaken, remedy
from grader.diagnosis.process.not_called import held_up_below
from grader.findings.finding import Evidence, Finding, Table, moment
from grader.findings.words import counted
from grader.measure import declarations
from grader.measure.compatibility import compatibility_table, refusals
from grader.measure.numbering import published
from grader.recording.model import NS, Endpoint, Join, Kind, Message, Recording
from grader.spec.unit import format_duration

_SHOWN = 50


@dataclass(frozen=True)
class OtherHistory(Symptom[Finding]):
    """A late joiner got other messages than the last ones that were published before it.

    Attributes:
        last: How many messages from before it joined it must get.
        history: What it got of them.
        before: What was published before, as far as the recording has it.
        number: How many messages were published before.
        least: How many of them it must get. A message that was published while it was matched
            may count on either side.
    """

    recording: Recording
    topic: str
    last: int
    join: Join
    history: list[Message]
    before: list[Message]
    number: int
    least: int

    @classmethod
    def of(cls, recording: Recording, topic: str, last: int, join: Join) -> OtherHistory:
        """What a late joiner got, and what had been published before it joined."""
        received, recorded = recording.joined.get(join.name, ()), recording.on(topic)
        history = _published_until(received, join.joined_ns)
        before = _published_until(recorded, join.joined_ns) if recorded else history
        # Where nothing else was subscribed, the writer's numbers tell.
        if recorded:
            number = len(before)
        elif history:
            number = published(history)
        else:
            number = published(received[:1]) - 1 if received else 0
        # What is kept arrives with the match, so that what was published later is live.
        first_ns = min((item.received_ns for item in received), default=join.joined_ns)
        times_ns = [item.stamp_ns for item in recorded or received]
        meanwhile = len([one for one in times_ns if join.joined_ns < one <= first_ns])
        return cls(recording, topic, last, join, history, before, number, max(0, last - meanwhile))

    @property
    def seen(self) -> str:
        """The symptom in words."""
        before = f"{counted(self.number, 'message')} published before it"
        return f"it got {len(self.history)} of the {before}"

    @property
    def is_newest(self) -> bool:
        """Whether what came is the newest of what was published, without a gap."""
        newest = self.before[-len(self.history) :] if self.history else []
        return {item.stamp_ns for item in self.history} == {item.stamp_ns for item in newest}

    @property
    def publishers(self) -> tuple[Endpoint, ...]:
        """The student's publishers on the topic."""
        return self.recording.student_endpoints(Kind.PUBLISHER, self.topic)

    @property
    def depth(self) -> int | None:
        """The depth of the first of them, as the process declared it."""
        queues = declarations.queues(self.recording, Kind.PUBLISHER, self.topic)
        return next((queue.depth for queue in queues if queue.depth is not None), None)

    @property
    def hint(self) -> str:
        """What keeps as much as is asked for."""
        return remedy("keeps_last", last=self.last) if self.last else remedy("keeps_nothing")

    @property
    def evidence(self) -> Evidence:
        """When it joined, and which of the messages it got."""
        got = {item.stamp_ns for item in self.history}
        rows = tuple(
            (
                str(number),
                f"{self.recording.since_launch_s(item.stamp_ns):.2f} s",
                "yes" if item.stamp_ns in got else "no",
            )
            for number, item in enumerate(self.before, start=1)
        )
        name = self.join.name
        times = {"joined": self.join.joined_ns, "matched": self.join.matched_ns}
        moments = tuple(
            moment(self.recording, f"{name} {what}", time_ns)
            for what, time_ns in times.items()
            if time_ns is not None
        )
        header = ("message", "published after launch", "got by the late joiner")
        table = Table(f"Messages before {name} joined", header, rows[-_SHOWN:])
        return Evidence(moments, tables=(table,))


class UnpublishedBefore(OtherHistory, concept="qos"):
    """Little or nothing was published before the late joiner, the only subscription."""

    @property
    def seen(self) -> str:
        """The symptom in words."""
        number = counted(self.number, "message was", "messages were")
        return f"{number} published before it, while there was no subscription"


class TooManyKept(OtherHistory, concept="qos"):
    """A late joiner got more messages than it should."""


class TooFewKept(OtherHistory, concept="qos"):
    """A late joiner got fewer messages than it should."""


def _published_until(messages: tuple[Message, ...], time_ns: int) -> list[Message]:
    return sorted(
        (item for item in messages if item.stamp_ns <= time_ns),
        key=lambda item: (item.stamp_ns, item.sequence),
    )


@explanation(TooFewKept)
def offers_less(symptom: TooFewKept) -> Finding | None:
    """The publisher offers less than the late joiner requests, such as volatile."""
    for publisher in symptom.publishers:
        refused = refusals(publisher.qos, symptom.join.qos)
        if refused:
            table = compatibility_table(publisher.qos, symptom.join.qos)
            shown = symptom.evidence
            return mistaken(
                "offers_too_little",
                f"it got nothing at all: {', '.join(refused)}",
                replace(shown, tables=(table, *shown.tables)),
                hint=symptom.hint,
            )
    return None


@explanation(TooFewKept)
def lifespan_over(symptom: TooFewKept) -> Finding | None:
    """Messages that should be kept are older than the publisher's lifespan."""
    lifespans = [one.qos.lifespan_s for one in symptom.publishers if one.qos.lifespan_s is not None]
    known = len(symptom.before) >= symptom.last
    launched_ns = symptom.recording.launched_ns
    oldest_ns = symptom.before[-symptom.last].stamp_ns if known else launched_ns
    if not lifespans or min(lifespans) >= (symptom.join.joined_ns - oldest_ns) / NS:
        return None
    return mistaken(
        "lifespan_over",
        f"{symptom.seen}: the publisher's lifespan is {format_duration(min(lifespans))}, and what "
        "is older is thrown away",
        symptom.evidence,
    )


@explanation(TooFewKept)
def never_matched(symptom: TooFewKept) -> Finding | None:
    """The publisher was destroyed, or the machine kept both from discovering each other."""
    recording, join = symptom.recording, symptom.join
    if join.matched_ns is not None or not symptom.publishers:
        return None
    waited_s = format_duration((recording.stop_ns - join.joined_ns) / NS)
    return why_unpublished(recording, symptom.topic, symptom.seen) or Finding.undecided(
        f"the late joiner was not matched within {waited_s}"
    )


@explanation(TooFewKept, UnpublishedBefore)
def publisher_destroyed(symptom: OtherHistory) -> Finding | None:
    """The program destroyed a publisher before, and what a publisher keeps is lost with it."""
    joined_ns, publishers = symptom.join.joined_ns, symptom.publishers
    gone = len([one for one in publishers if (one.vanished_ns or math.inf) <= joined_ns])
    if gone in (0, len(publishers)):
        return None
    number = counted(gone, "publisher was", "publishers were")
    lost = "what a publisher keeps is lost with it"
    observed = f"{symptom.seen}: {number} destroyed before it joined, and {lost}"
    return mistaken("one_publisher", observed, symptom.evidence)


@explanation(TooFewKept)
def lost_on_the_way(symptom: TooFewKept) -> Finding | None:
    """The depth is right, and messages were lost on their way; this costs no points."""
    if symptom.depth is None or symptom.depth < symptom.last:
        return None
    seen = f"{symptom.seen}, although the publisher's depth is {symptom.depth}"
    return Finding.undecided(f"{seen}: the rest was lost on its way")


@explanation(TooManyKept)
def several_publishers(symptom: TooManyKept) -> Finding | None:
    """Several publishers keep messages, each its own."""
    if len(symptom.publishers) < 2:
        return None
    each = f"of {len(symptom.publishers)} publishers, each of which keeps its own"
    return mistaken("one_publisher", f"{symptom.seen}, {each}", symptom.evidence)


@explanation(TooFewKept, TooManyKept, general=True)
def other_depth(symptom: OtherHistory) -> Finding:
    """The publisher's queue has another depth, or keeps all messages."""
    queues = declarations.queues(symptom.recording, Kind.PUBLISHER, symptom.topic)
    number = len(symptom.history)
    if number > symptom.last and any(queue.history == "keep_all" for queue in queues):
        why = ": the publisher's history is keep_all, declared by the process"
    elif symptom.depth not in (None, symptom.last):
        why = f": the publisher's depth is {symptom.depth}, declared by the process"
    else:
        why = f": the publisher keeps {number}" if number >= symptom.last else ""
    return Finding(f"{symptom.seen}{why}", symptom.hint, symptom.evidence)


@explanation(UnpublishedBefore)
def no_cpu_time(symptom: UnpublishedBefore) -> Finding | None:
    """The machine gave the process too little CPU time; this is an error and costs no points."""
    recording, number, span_ns = symptom.recording, symptom.number, _watched_ns(symptom)
    return held_up_below(recording, symptom.seen, number, symptom.last, span_ns)


@explanation(UnpublishedBefore, general=True)
def waits_for_a_subscription(symptom: UnpublishedBefore) -> Finding:
    """It publishes only while there is a subscription."""
    begin_ns, joined_ns = _watched_ns(symptom)
    return mistaken(
        "waits_for_a_subscription",
        f"{symptom.seen} ({format_duration((joined_ns - begin_ns) / NS)})",
        symptom.evidence,
    )


def _watched_ns(symptom: OtherHistory) -> tuple[int, int]:
    recording = symptom.recording
    return recording.matched_ns or recording.launched_ns, symptom.join.joined_ns
