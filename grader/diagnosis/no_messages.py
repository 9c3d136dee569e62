"""Why no message arrived on a topic: one cause, the deepest that can be seen."""

from __future__ import annotations

from dataclasses import dataclass, replace

from grader.checks.doubt import was_held_up
from grader.checks.finding import Evidence, Moment
from grader.checks.first_seen import endpoints_seen, until_the_end
from grader.checks.wording import code, codes, counted, listing
from grader.diagnosis.cause import Cause
from grader.diagnosis.delivery import why_not_delivered
from grader.diagnosis.destroyed_endpoint import why_unpublished
from grader.diagnosis.explanation import Symptom, cause_of, explanation
from grader.diagnosis.no_answer import why_never_awaited, why_raised
from grader.diagnosis.no_endpoint import why_no_endpoint
from grader.diagnosis.process.blocked_executor import left_s, why_blocked, why_never_spun
from grader.diagnosis.process.process_exit import why_ended
from grader.diagnosis.process.raised import interrupted_place
from grader.diagnosis.sim_time import why_time_stands_still
from grader.measure import compatibility, declarations
from grader.recording.model import NS, Endpoint, Kind, Owner, Recording
from grader.spec.unit import format_duration
from grader.submission.record import SourceError

_LOG_LINES = 5
SECONDS_HINT = "create_timer takes its period in seconds: 0.3 is 300 ms."
ENDED_HINT = (
    "Publish in every call of the callback. Look for a counter or a condition that ends it, for "
    "timer.cancel() and timer.reset(), and for a callback that does not return."
)
# Share of the observation that the host may take before silence says nothing any more.
_STARVED = 0.5
# Without what the host took: in so long a node answers what it was asked.
_OWN_S = 2.0


@dataclass(frozen=True)
class NoMessages(Symptom[Cause]):
    """No message came on a topic."""

    recording: Recording
    topic: str

    @property
    def seen(self) -> str:
        """The symptom in words."""
        return f"no message on {code(self.topic)}"

    @property
    def publishers(self) -> tuple[Endpoint, ...]:
        """The student's publishers on the topic."""
        return self.recording.student_endpoints(Kind.PUBLISHER, self.topic)

    @property
    def nodes(self) -> set[str]:
        """The nodes that have them."""
        return {item.node for item in self.publishers}

    @property
    def readers(self) -> list[Endpoint]:
        """The probe's subscriptions to the topic."""
        return [
            item
            for item in self.recording.endpoints
            if item.owner is Owner.PROBE
            and item.kind is Kind.SUBSCRIPTION
            and item.topic == self.topic
        ]

    @property
    def asked(self) -> tuple[str, ...]:
        """Topics that the probe publishes on and that this one answers, as far as it is said."""
        answers = self.recording.answers
        return tuple(
            name for name in self.recording.sent if answers.get(name, self.topic) == self.topic
        )


def why_silent(recording: Recording, topic: str) -> Cause:
    """Why nothing was recorded on a topic."""
    return cause_of(NoMessages(recording, topic))


@explanation(NoMessages)
def no_publisher(symptom: NoMessages) -> Cause | None:
    """The node has no publisher on the topic."""
    return why_no_endpoint(symptom.recording, Kind.PUBLISHER, symptom.topic)


@explanation(NoMessages)
def other_type(symptom: NoMessages) -> Cause | None:
    """The publisher has another message type."""
    wanted = {item.type for item in symptom.readers}
    found = {item.type for item in symptom.publishers}
    if not wanted or not found or wanted & found:
        return None
    return Cause(
        f"no message could be read: {code(symptom.topic)} has the type {codes(sorted(found))}, "
        f"not {codes(sorted(wanted), last='or')}",
        "A publisher and a subscription meet only if their types are the same.",
        Evidence(moments=endpoints_seen(symptom.recording, symptom.publishers)),
    )


@explanation(NoMessages)
def other_definition(symptom: NoMessages) -> Cause | None:
    """The message type has the right name, but other fields than the assignment asks for."""
    if not symptom.recording.misdefined(symptom.topic):
        return None
    return Cause(
        f"no message on {code(symptom.topic)} could be read: its type "
        f"{code(symptom.publishers[0].type)} has the right name, but another definition",
        "Compare the definition with the one that was asked for: the types, names, array bounds "
        "and order of its fields must be the same.",
        Evidence(moments=endpoints_seen(symptom.recording, symptom.publishers)),
    )


@explanation(NoMessages)
def unreadable(symptom: NoMessages) -> Cause | None:
    """The program publishes bytes that are no message of the type."""
    return why_unreadable(symptom.recording, symptom.topic)


@explanation(NoMessages)
def incompatible_qos(symptom: NoMessages) -> Cause | None:
    """The publisher offers less (reliability, durability, deadline) than its reader requests."""
    publishers, readers = symptom.publishers, symptom.readers
    reasons = [
        compatibility.refusals(offered=publisher.qos, requested=reader.qos)
        for publisher in publishers
        for reader in readers
    ]
    if not reasons or not all(reasons):
        return None
    return Cause(
        f"no message on {code(symptom.topic)}: the publisher's QoS does not match its reader "
        f"({', '.join(reasons[0])})",
        "A subscription receives nothing from a publisher that offers less than it requests.",
        Evidence(
            moments=endpoints_seen(symptom.recording, publishers),
            tables=(
                compatibility.compatibility_table(
                    offered=publishers[0].qos, requested=readers[0].qos
                ),
            ),
        ),
    )


@explanation(NoMessages)
def never_matched(symptom: NoMessages) -> Cause | None:
    """The busy machine kept the publisher and the probe from discovering each other."""
    if not was_held_up(symptom.recording) or not any(
        item.data.get("topic") == symptom.topic and item.data.get("matched") is False
        for item in symptom.recording.declared("held")
    ):
        return None
    return Cause.to_repeat(
        f"the publisher on {code(symptom.topic)} was not matched by the probe in time, so a "
        "message could be lost"
    )


@explanation(NoMessages)
def process_ended(symptom: NoMessages) -> Cause | None:
    """The process ended before it published."""
    return why_ended(symptom.recording, symptom.seen)


@explanation(NoMessages)
def publisher_destroyed(symptom: NoMessages) -> Cause | None:
    """The program destroyed its publisher."""
    return why_unpublished(symptom.recording, symptom.topic, symptom.seen)


@explanation(NoMessages)
def nothing_to_answer(symptom: NoMessages) -> Cause | None:
    """The messages that the node should answer did not reach it."""
    causes = [why_not_delivered(symptom.recording, name) for name in symptom.asked]
    cause = causes[0] if causes and all(causes) else None
    return cause and cause.after(
        f"{symptom.seen}, because what the node should answer, on {code(symptom.asked[0])}, "
        "never reached it"
    )


@explanation(NoMessages)
def slow_timer(symptom: NoMessages) -> Cause | None:
    """The timer's period is longer than the observation: milliseconds were given as seconds."""
    timer = None if symptom.asked else _slow_timer(symptom.recording)
    if timer is None:
        return None
    recording = symptom.recording
    watched_s = recording.since_launch_s(recording.stop_ns)
    return Cause(
        f"{symptom.seen} in {format_duration(watched_s)}: the process declared a "
        f"timer of {format_duration(timer.period_s)}",
        SECONDS_HINT,
        Evidence(
            moments=(
                Moment("timer declared", recording.since_launch_s(timer.declared_ns)),
                until_the_end(recording),
            )
        ),
    )


@explanation(NoMessages)
def no_cpu_time(symptom: NoMessages) -> Cause | None:
    """The machine gave the process too little CPU time; an error, and never a lost point."""
    recording = symptom.recording
    begin_ns = recording.matched_ns or recording.launched_ns
    stolen_s = recording.stolen_s(begin_ns, recording.stop_ns)
    watched_s = (recording.stop_ns - begin_ns) / NS
    if stolen_s < _STARVED * watched_s:
        return None
    # A callback that never returns burns what CPU the machine leaves it.
    guilty = blocked_executor(symptom)
    begins_ns = [recording.sent[name][0].stamp_ns for name in symptom.asked if recording.sent[name]]
    if not guilty and begins_ns and left_s(recording, min(begins_ns), recording.stop_ns) >= _OWN_S:
        guilty = no_answer(symptom)
    if guilty:
        return replace(guilty, disturbed=True)
    return Cause.to_repeat(
        f"{symptom.seen}, but the machine took {format_duration(stolen_s)} of "
        f"{format_duration(watched_s)} from the process"
    )


@explanation(NoMessages)
def never_spun(symptom: NoMessages) -> Cause | None:
    """rclpy.spin() is never called, or the node is not given to the executor that spins."""
    return why_never_spun(symptom.recording, symptom.seen, symptom.nodes)


@explanation(NoMessages)
def time_stands_still(symptom: NoMessages) -> Cause | None:
    """The node uses simulated time, which no simulator publishes, so its timers never fire."""
    return why_time_stands_still(symptom.recording, symptom.seen)


@explanation(NoMessages)
def blocked_executor(symptom: NoMessages) -> Cause | None:
    """A callback does not return, and blocks the executor."""
    sent = symptom.recording.sent
    begin_ns = [sent[name][0].stamp_ns for name in symptom.asked if sent[name]]
    since_ns = min(begin_ns, default=symptom.recording.launched_ns)
    return why_blocked(symptom.recording, symptom.seen, symptom.nodes, since_ns)


@explanation(NoMessages)
def never_awaited(symptom: NoMessages) -> Cause | None:
    """A coroutine is called without `await`, so nothing of it runs."""
    return why_never_awaited(symptom.recording, symptom.seen)


@explanation(NoMessages)
def no_answer(symptom: NoMessages) -> Cause | None:
    """The subscription's callback gets its message, but does not publish, or raises."""
    recording = symptom.recording
    name = next((name for name in symptom.asked if recording.sent[name]), None)
    if name is None:
        return None
    sent = recording.sent[name]
    seen = (
        f"{symptom.seen}, although {counted(len(sent), 'message')} on {code(name)} reached the node"
    )
    return why_raised(recording, seen, sent[0].stamp_ns) or Cause(
        seen,
        "Is publish(msg) reached in the subscription's callback? An `except: pass` hides the error "
        "that would tell why not, and a lock or a loop that never ends keeps it waiting.",
        Evidence(
            moments=(Moment(f"sent on {name}", recording.since_launch_s(sent[0].stamp_ns)),),
            places=_interrupted(recording),
        ),
    )


@explanation(NoMessages)
def callback_without_publish(symptom: NoMessages) -> Cause | None:
    """The subscription's callback is called, but a condition keeps it from publishing."""
    heard = _heard(symptom.recording, symptom.topic)
    if not heard or declarations.said(symptom.recording, "timer"):
        return None
    return Cause(
        f"{_idle(symptom)}, although {heard} reached the node",
        "Is publish(msg) reached in the subscription's callback? Look for a condition or a "
        "`return` before it, and for an `except: pass` that hides an error.",
        _idle_evidence(symptom),
    )


@explanation(NoMessages)
def no_timer(symptom: NoMessages) -> Cause | None:
    """No timer was created, so nothing calls the callback that publishes."""
    recording = symptom.recording
    if not declarations.traced(recording) or declarations.said(recording, "timer"):
        return None
    return Cause(
        f"{_idle(symptom)}, and the process declared no timer that would call it",
        "Is publish(msg) reached? Look for a condition before it, and for a loop that waits "
        "for what never comes, such as subscriptions. A callback publishes only if something "
        "calls it: self.create_timer(period_in_seconds, self.callback) does.",
        _idle_evidence(symptom),
    )


@explanation(NoMessages)
def lambda_without_call(symptom: NoMessages) -> Cause | None:
    """The timer's callback is a lambda that names the method and does not call it."""
    timers = _firing(symptom.recording)
    if not timers or not all(timer.callback.endswith("<lambda>") for timer in timers):
        return None
    return Cause(
        _idle(symptom) + _although(symptom.recording),
        "A lambda has to call the method, with brackets: `lambda: self.callback()`. Without a "
        "lambda it is self.callback, without brackets.",
        _idle_evidence(symptom),
    )


@explanation(NoMessages, general=True)
def publish_not_reached(symptom: NoMessages) -> Cause:
    """The publisher is there, but the program does not come to its publish()."""
    return Cause(
        _idle(symptom) + _although(symptom.recording),
        "Is publish(msg) reached in the callback? Printing or logging a message does not send it, "
        "an `except: pass` hides the error that would tell why not, a lock that is never free "
        "keeps it waiting, timer.cancel() ends it, and timer.reset() again and again lets its "
        "period never end.",
        _idle_evidence(symptom),
    )


def _idle(symptom: NoMessages) -> str:
    return f"the publisher on {code(symptom.topic)} is there but silent"


def _idle_evidence(symptom: NoMessages) -> Evidence:
    recording = symptom.recording
    # What it prints after Ctrl+C tells of its end, which any right node may word as a traceback.
    complaints = [
        line.text
        for line in recording.log
        if line.stream == "stderr" and line.time_ns <= recording.stop_ns
    ]
    return Evidence(
        moments=(
            *endpoints_seen(recording, symptom.publishers),
            until_the_end(recording, "still no message when the observation ended"),
        ),
        places=_interrupted(recording),
        log=tuple(complaints[-_LOG_LINES:]),
    )


def _firing(recording: Recording) -> list[declarations.DeclaredTimer]:
    return [timer for timer in declarations.timers(recording) if _fires(recording, timer)]


def _although(recording: Recording) -> str:
    runs = [format_duration(timer.period_s) for timer in _firing(recording)]
    if not runs or not declarations.said(recording, "spin"):
        return ""
    return f", although the process declared a timer of {listing(runs)}"


def why_unreadable(recording: Recording, topic: str) -> Cause | None:
    """Why messages on a topic could not be read, or None where all could."""
    number = recording.unreadable.get(topic, 0)
    if not number:
        return None
    publishers = recording.student_endpoints(Kind.PUBLISHER, topic)
    return Cause(
        f"{counted(number, 'message')} on {code(topic)} cannot be read: what was published are "
        "other bytes than a message of its type has",
        "Give publish() a message object: bytes are published as they are.",
        Evidence(moments=endpoints_seen(recording, publishers)),
    )


def _slow_timer(recording: Recording) -> declarations.DeclaredTimer | None:
    """A declared timer that could not fire before the end of the observation, if all are such."""
    timers = declarations.timers(recording)
    if not timers or any(_fires(recording, timer) for timer in timers):
        return None
    return min(timers, key=lambda timer: timer.period_s)


def _fires(recording: Recording, timer: declarations.DeclaredTimer) -> bool:
    return timer.declared_ns + timer.period_s * NS <= recording.stop_ns


def _heard(recording: Recording, topic: str) -> str:
    """What the node was sent, in words, but for what it answers elsewhere; empty without any."""
    topics = {item.topic for item in recording.student_endpoints(Kind.SUBSCRIPTION)}
    told = [
        f"{counted(len(recording.carried(name)), 'message')} on {code(name)}"
        for name in sorted(topics)
        if recording.answers.get(name, topic) == topic
        and recording.carried(name)
        and why_not_delivered(recording, name) is None
    ]
    return listing(told)


def _interrupted(recording: Recording) -> tuple[SourceError, ...]:
    places = (interrupted_place(recording, process.name) for process in recording.processes)
    return tuple(place for place in places if place)
