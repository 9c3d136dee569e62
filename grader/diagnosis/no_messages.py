"""Why no message arrived on a topic: one cause, the deepest that can be seen."""

from __future__ import annotations

from dataclasses import replace

from grader.checks import declarations
from grader.checks.doubt import was_held_up
from grader.checks.finding import Evidence, Moment
from grader.checks.first_seen import endpoints_seen, until_the_end
from grader.checks.qos import compatibility
from grader.checks.wording import code, codes, counted, listing
from grader.diagnosis.cause import Cause
from grader.diagnosis.delivery import why_not_delivered
from grader.diagnosis.destroyed_endpoint import why_unpublished
from grader.diagnosis.no_answer import why_never_awaited, why_raised
from grader.diagnosis.no_endpoint import why_no_endpoint
from grader.diagnosis.process.blocked_executor import left_s, why_blocked, why_never_spun
from grader.diagnosis.process.process_exit import why_ended
from grader.diagnosis.process.raised import interrupted_place
from grader.diagnosis.sim_time import why_time_stands_still
from grader.recording.model import NS, Endpoint, Kind, Owner, Recording
from grader.spec.unit import format_duration
from grader.submission.record import SourceError

_LOG_LINES = 5
_SECONDS_HINT = "create_timer takes its period in seconds: 0.3 is 300 ms."
ENDED_HINT = (
    "Publish in every call of the callback. Look for a counter or a condition that ends it, for "
    "timer.cancel() and timer.reset(), and for a callback that does not return."
)
# After so many periods of silence a timer has stopped.
_ENDED_PERIODS = 3.0
# Share of the observation that the host may take before silence says nothing any more.
_STARVED = 0.5
# Without what the host took: in so long a node answers what it was asked.
_OWN_S = 2.0


def why_silent(recording: Recording, topic: str) -> Cause:
    """Why nothing was recorded on a topic."""
    cause = why_no_endpoint(recording, Kind.PUBLISHER, topic)
    if cause is not None:
        return cause
    publishers = recording.student_endpoints(Kind.PUBLISHER, topic)
    readers = [
        item
        for item in recording.endpoints
        if item.owner is Owner.PROBE and item.kind is Kind.SUBSCRIPTION and item.topic == topic
    ]
    cause = (
        _other_type(recording, topic, publishers, readers)
        or _other_definition(recording, topic, publishers)
        or why_unreadable(recording, topic)
        or _unmatched(recording, topic, publishers, readers)
        or _held_in_vain(recording, topic)
    )
    seen = f"no message on {code(topic)}"
    cause = cause or why_ended(recording, seen)
    if cause is not None:
        return cause
    asked = _asked_on(recording, topic)
    nodes = {item.node for item in publishers}
    begin_ns = [recording.sent[name][0].stamp_ns for name in asked if recording.sent[name]]
    blocked = why_blocked(recording, seen, nodes, min(begin_ns, default=recording.launched_ns))
    starved = _starved(recording, topic)
    own_s = left_s(recording, min(begin_ns), recording.stop_ns) if begin_ns else 0.0
    guilty = blocked or (_unanswered(recording, topic, asked) if own_s >= _OWN_S else None)
    return (
        why_unpublished(recording, topic, seen)
        or _undelivered(recording, topic, asked)
        or (_slow(recording, topic) if not asked else None)
        # A callback that never returns burns what CPU the machine leaves it.
        or (starved and guilty and replace(guilty, disturbed=True))
        or starved
        or why_never_spun(recording, seen, nodes)
        or why_time_stands_still(recording, seen)
        or blocked
        or why_never_awaited(recording, seen)
        or _unanswered(recording, topic, asked)
        or _idle(recording, topic)
    )


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


def why_few(recording: Recording, topic: str, needed: int) -> Cause:
    """Why fewer messages than needed were recorded on a topic."""
    messages = recording.on(topic)
    if not messages:
        return why_silent(recording, topic)
    unreadable = why_unreadable(recording, topic)
    if unreadable is not None:
        return unreadable
    begin_ns = recording.matched_ns or recording.launched_ns
    watched_s = (recording.stop_ns - begin_ns) / NS
    seen = f"{counted(len(messages), 'message')} on {code(topic)} in {format_duration(watched_s)}"
    ended = why_ended(recording, seen)
    if ended is not None:
        return ended
    moments = tuple(
        Moment(f"message {index}", recording.since_launch_s(message.stamp_ns))
        for index, message in enumerate(messages[:10], start=1)
    )
    stolen_s = recording.stolen_s(begin_ns, recording.stop_ns)
    # With the time that was taken from it, the node may have come to as many as are needed.
    if stolen_s > 0.0 and len(messages) * watched_s >= needed * (watched_s - stolen_s):
        return Cause.to_repeat(
            f"{seen}, but the machine took {format_duration(stolen_s)} of them from the process"
        )
    destroyed = why_unpublished(recording, topic, seen)
    if destroyed is not None:
        return destroyed
    period_s = [timer.period_s for timer in declarations.timers(recording)]
    periods = list(map(format_duration, period_s))
    unspun = why_never_spun(recording, seen, moments=moments) if periods else None
    if unspun is not None:
        return unspun
    timers = f"; the process declared a timer of {listing(periods)}" if periods else ""
    silent_s = (recording.stop_ns - messages[-1].stamp_ns) / NS
    if period_s and silent_s > _ENDED_PERIODS * max(period_s):
        return Cause(
            f"{seen}, none in the last {format_duration(silent_s)}{timers}",
            ENDED_HINT,
            Evidence(moments=moments),
        )
    slow = _SECONDS_HINT if needed * min(period_s, default=0.0) > watched_s else ENDED_HINT
    return Cause(
        seen + timers,
        slow
        if period_s
        else "Publish from the callback of a timer, which goes on as long as the node spins.",
        Evidence(moments=moments),
    )


def _slow_timer(recording: Recording) -> declarations.DeclaredTimer | None:
    """A declared timer that could not fire before the end of the observation, if all are such."""
    timers = declarations.timers(recording)
    if not timers or any(_fires(recording, timer) for timer in timers):
        return None
    return min(timers, key=lambda timer: timer.period_s)


def _fires(recording: Recording, timer: declarations.DeclaredTimer) -> bool:
    return timer.declared_ns + timer.period_s * NS <= recording.stop_ns


def _other_type(
    recording: Recording, topic: str, publishers: tuple[Endpoint, ...], readers: list[Endpoint]
) -> Cause | None:
    wanted = {item.type for item in readers}
    found = {item.type for item in publishers}
    if not wanted or not found or wanted & found:
        return None
    return Cause(
        f"no message could be read: {code(topic)} has the type {codes(sorted(found))}, "
        f"not {codes(sorted(wanted), last='or')}",
        "A publisher and a subscription meet only if their types are the same.",
        Evidence(moments=endpoints_seen(recording, publishers)),
    )


def _other_definition(
    recording: Recording, topic: str, publishers: tuple[Endpoint, ...]
) -> Cause | None:
    if not recording.misdefined(topic):
        return None
    return Cause(
        f"no message on {code(topic)} could be read: its type {code(publishers[0].type)} has the "
        "right name, but another definition",
        "Compare the definition with the one that was asked for: the types, names, array bounds "
        "and order of its fields must be the same.",
        Evidence(moments=endpoints_seen(recording, publishers)),
    )


def _unmatched(
    recording: Recording, topic: str, publishers: tuple[Endpoint, ...], readers: list[Endpoint]
) -> Cause | None:
    """No reader of ours could match: each refuses a policy."""
    if not publishers or not readers:
        return None
    reasons = [
        compatibility.refusals(offered=publisher.qos, requested=reader.qos)
        for publisher in publishers
        for reader in readers
    ]
    if not all(reasons):
        return None
    return Cause(
        f"no message on {code(topic)}: the publisher's QoS does not match its reader "
        f"({', '.join(reasons[0])})",
        "A subscription receives nothing from a publisher that offers less than it requests.",
        Evidence(
            moments=endpoints_seen(recording, publishers),
            tables=(
                compatibility.compatibility_table(
                    offered=publishers[0].qos, requested=readers[0].qos
                ),
            ),
        ),
    )


def _held_in_vain(recording: Recording, topic: str) -> Cause | None:
    """A publisher that our tracer held for its match, and that found none: its message is lost."""
    if not was_held_up(recording) or not any(
        item.data.get("topic") == topic and item.data.get("matched") is False
        for item in recording.declared("held")
    ):
        return None
    return Cause.to_repeat(
        f"the publisher on {code(topic)} was not matched by the probe in time, so a message could "
        "be lost"
    )


def _asked_on(recording: Recording, topic: str) -> tuple[str, ...]:
    """Topics that the probe publishes on and that a topic answers, as far as it is said."""
    return tuple(name for name in recording.sent if recording.answers.get(name, topic) == topic)


def _undelivered(recording: Recording, topic: str, asked: tuple[str, ...]) -> Cause | None:
    """What the node should answer never reached it."""
    causes = [why_not_delivered(recording, name) for name in asked]
    cause = causes[0] if causes and all(causes) else None
    return cause and cause.after(
        f"no message on {code(topic)}, because what the node should answer, on {code(asked[0])}, "
        "never reached it"
    )


def _unanswered(recording: Recording, topic: str, asked: tuple[str, ...]) -> Cause | None:
    """It got what it should answer, and did not."""
    name = next((name for name in asked if recording.sent[name]), None)
    if name is None:
        return None
    sent = recording.sent[name]
    seen = (
        f"no message on {code(topic)}, although {counted(len(sent), 'message')} on {code(name)} "
        "reached the node"
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


def _starved(recording: Recording, topic: str) -> Cause | None:
    begin_ns = recording.matched_ns or recording.launched_ns
    stolen_s = recording.stolen_s(begin_ns, recording.stop_ns)
    watched_s = (recording.stop_ns - begin_ns) / NS
    if stolen_s < _STARVED * watched_s:
        return None
    return Cause.to_repeat(
        f"no message on {code(topic)}, but the machine took {format_duration(stolen_s)} of "
        f"{format_duration(watched_s)} from the process"
    )


def _slow(recording: Recording, topic: str) -> Cause | None:
    timer = _slow_timer(recording)
    if timer is None:
        return None
    watched_s = recording.since_launch_s(recording.stop_ns)
    return Cause(
        f"no message on {code(topic)} in {format_duration(watched_s)}: the process declared a "
        f"timer of {format_duration(timer.period_s)}",
        _SECONDS_HINT,
        Evidence(
            moments=(
                Moment("timer declared", recording.since_launch_s(timer.declared_ns)),
                until_the_end(recording),
            )
        ),
    )


def _idle(recording: Recording, topic: str) -> Cause:
    # What it prints after Ctrl+C tells of its end, which any right node may word as a traceback.
    complaints = [
        line.text
        for line in recording.log
        if line.stream == "stderr" and line.time_ns <= recording.stop_ns
    ]
    publishers = recording.student_endpoints(Kind.PUBLISHER, topic)
    evidence = Evidence(
        moments=(
            *endpoints_seen(recording, publishers),
            until_the_end(recording, "still no message when the observation ended"),
        ),
        places=_interrupted(recording),
        log=tuple(complaints[-_LOG_LINES:]),
    )
    heard = _heard(recording, topic)
    if heard and not declarations.said(recording, "timer"):
        return Cause(
            f"the publisher on {code(topic)} is there but silent, although {heard} reached the "
            "node",
            "Is publish(msg) reached in the subscription's callback? Look for a condition or a "
            "`return` before it, and for an `except: pass` that hides an error.",
            evidence,
        )
    traced = declarations.traced(recording)
    if traced and not declarations.said(recording, "timer"):
        return Cause(
            f"the publisher on {code(topic)} is there but silent, and the process declared no "
            "timer that would call it",
            "Is publish(msg) reached? Look for a condition before it, and for a loop that waits "
            "for what never comes, such as subscriptions. A callback publishes only if something "
            "calls it: self.create_timer(period_in_seconds, self.callback) does.",
            evidence,
        )
    timers = [timer for timer in declarations.timers(recording) if _fires(recording, timer)]
    runs = [format_duration(timer.period_s) for timer in timers]
    spins = declarations.said(recording, "spin")
    though = f", although the process declared a timer of {listing(runs)}" if runs and spins else ""
    seen = f"the publisher on {code(topic)} is there but silent{though}"
    if runs and all(timer.callback.endswith("<lambda>") for timer in timers):
        hint = (
            "A lambda has to call the method, with brackets: `lambda: self.callback()`. Without a "
            "lambda it is self.callback, without brackets."
        )
        return Cause(seen, hint, evidence)
    return Cause(
        seen,
        "Is publish(msg) reached in the callback? Printing or logging a message does not send it, "
        "an `except: pass` hides the error that would tell why not, a lock that is never free "
        "keeps it waiting, timer.cancel() ends it, and timer.reset() again and again lets its "
        "period never end.",
        evidence,
    )


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
