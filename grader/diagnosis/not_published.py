"""Why a program does not publish, or stops, although its publisher is matched."""

from __future__ import annotations

from grader.diagnosis.explanation import explanation, mistaken, remedy
from grader.diagnosis.no_messages import (
    FewMessages,
    NoMessages,
    no_answer,
    nothing_to_answer,
    seconds_hint,
    why_not_delivered,
    why_unheard,
)
from grader.diagnosis.process.not_called import callback_raised, no_cpu_time
from grader.diagnosis.process.raised import defined_at
from grader.findings.finding import Evidence, Finding, moment, until_the_end
from grader.findings.words import code, codes, counted, listing
from grader.measure import declarations
from grader.measure.declarations import is_compiled
from grader.recording.model import NS, Kind, Owner, Recording
from grader.spec.unit import format_duration

_LOG_LINES = 5


@explanation(NoMessages, after=(nothing_to_answer,), before=(no_cpu_time,), concept="timers")
def slow_timer(symptom: NoMessages) -> Finding | None:
    """The timer's period is longer than the observation: milliseconds were given as seconds."""
    recording, timers = symptom.recording, declarations.timers(symptom.recording)
    if symptom.asked or not timers or _firing(recording):
        return None
    timer = min(timers, key=lambda one: one.period_s)
    watched_s = recording.since_launch_s(recording.stop_ns)
    declared = moment(recording, "timer declared", timer.declared_ns)
    return Finding(
        f"{symptom.seen} in {format_duration(watched_s)}: the process declared a "
        f"timer of {format_duration(timer.period_s)}",
        seconds_hint(),
        Evidence((declared, until_the_end(recording))),
    )


@explanation(NoMessages, after=(no_cpu_time,), before=(callback_raised,))
def publish_never_called(symptom: NoMessages) -> Finding | None:
    """No line of the program calls publish()."""
    sources = [file for one in symptom.recording.submission.packages for file in one.sources]
    of_python = not any(
        is_compiled(symptom.recording, one.name) for one in symptom.recording.processes
    )
    if not sources or not of_python or any("publish" in file.uses for file in sources):
        return None
    # Older records do not tell what a file uses.
    if not any(file.uses for file in sources):
        return None
    names = [timer.callback for timer in declarations.timers(symptom.recording)][:1]
    message = "this is called, and should publish"
    places = (defined_at(name, message, symptom.recording.submission) for name in names)
    return mistaken(
        "publish_never_called",
        f"{symptom.seen}: no line of the program calls publish()",
        Evidence(moments=symptom.moments, places=tuple(filter(None, places))),
    )


@explanation(NoMessages, after=(no_answer,), concept="qos")
def deaf_by_qos(symptom: NoMessages) -> Finding | None:
    """A subscription of the node gets nothing, because its QoS does not match the publisher."""
    cause = why_unheard(symptom.recording)
    return cause and cause.after(symptom.seen)


@explanation(NoMessages, after=(no_answer,), concept="names")
def hears_nothing(symptom: NoMessages) -> Finding | None:
    """It subscribes to a topic without a publisher, and its type comes on another topic."""
    ends = symptom.recording.endpoints
    sources = {one.topic: one.type for one in ends if one.kind is Kind.PUBLISHER}
    own = [one for one in ends if one.kind is Kind.SUBSCRIPTION and one.owner is Owner.STUDENT]
    for deaf in (one for one in own if one.topic not in sources):
        meant = sources.keys() - {one.topic for one in own}
        names = codes(sorted(name for name in meant if sources[name] == deaf.type))
        if names:
            return mistaken(
                "hears_nothing",
                f"{symptom.seen}: the node subscribes to {code(deaf.topic)}, which has no "
                f"publisher; {code(deaf.type)} comes on {names}",
                Evidence(moments=symptom.moments),
            )
    return None


@explanation(NoMessages, concept="timers")
def no_timer(symptom: NoMessages) -> Finding | None:
    """No timer was created, so nothing calls the callback that publishes."""
    recording = symptom.recording
    traced, timer = declarations.traced(recording), declarations.declares(recording, "timer")
    if not traced or timer or _heard(recording, symptom.topic):
        return None
    return symptom.placed(
        mistaken(
            "nothing_calls",
            f"{_idle(symptom)}, and the process declared no timer that would call publish()",
            _idle_evidence(symptom),
        ),
    )


@explanation(NoMessages, general=True)
def publish_not_reached(symptom: NoMessages) -> Finding:
    """The publisher is there, but the program does not reach its publish()."""
    recording = symptom.recording
    heard = _heard(recording, symptom.topic)
    periods = [format_duration(timer.period_s) for timer in _firing(recording)]
    although = ""
    if heard and not declarations.declares(recording, "timer"):
        although = f", although {heard} reached the node"
    elif periods and declarations.declares(recording, "spin"):
        although = f", although the process declared a timer of {listing(periods)}"
    return symptom.placed(
        mistaken("publish_not_reached", _idle(symptom) + although, _idle_evidence(symptom)),
    )


@explanation(FewMessages, general=True, concept="timers")
def publishing_stopped(symptom: FewMessages) -> Finding:
    """A timer stopped or is too slow, or the program publishes without a timer and stops."""
    recording, evidence = symptom.recording, Evidence(moments=symptom.moments)
    period_s = [timer.period_s for timer in declarations.timers(recording)]
    if not period_s:
        return mistaken("publishing_stopped", symptom.seen, evidence)
    is_slow = symptom.needed * min(period_s) > symptom.watched_s
    return Finding(
        f"{symptom.seen}; the process declared a timer of "
        f"{listing(map(format_duration, period_s))}",
        seconds_hint() if is_slow else remedy("ended"),
        evidence,
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
            *symptom.moments,
            until_the_end(recording, "still no message when the observation ended"),
        ),
        log=tuple(complaints[-_LOG_LINES:]),
    )


def _firing(recording: Recording) -> list[declarations.DeclaredTimer]:
    """Declared timers that could fire before the end of the observation."""
    return [
        timer
        for timer in declarations.timers(recording)
        if timer.declared_ns + timer.period_s * NS <= recording.stop_ns
    ]


def _heard(recording: Recording, topic: str) -> str:
    """The messages to the node in words, without those that it answers elsewhere; or empty."""
    topics = {item.topic for item in recording.student_endpoints(Kind.SUBSCRIPTION)}
    return listing(
        f"{counted(len(recording.carried(name)), 'message')} on {code(name)}"
        for name in sorted(topics)
        if recording.answers.get(name, topic) == topic
        and recording.carried(name)
        and why_not_delivered(recording, name) is None
    )
