"""Why too few messages came on a topic."""

from __future__ import annotations

from dataclasses import dataclass

from grader.checks.finding import Evidence, Moment
from grader.checks.wording import code, counted, listing
from grader.diagnosis.cause import Cause
from grader.diagnosis.destroyed_endpoint import why_unpublished
from grader.diagnosis.explanation import Symptom, cause_of, explanation
from grader.diagnosis.no_messages import ENDED_HINT, SECONDS_HINT, why_silent, why_unreadable
from grader.diagnosis.process.blocked_executor import why_never_spun
from grader.diagnosis.process.process_exit import why_ended
from grader.measure import declarations
from grader.recording.model import NS, Recording
from grader.spec.unit import format_duration

# After so many periods of silence a timer has stopped.
_ENDED_PERIODS = 3.0


@dataclass(frozen=True)
class FewMessages(Symptom[Cause]):
    """Too few messages came on a topic."""

    recording: Recording
    topic: str
    needed: int

    @property
    def begin_ns(self) -> int:
        """When the observation of the topic began."""
        return self.recording.matched_ns or self.recording.launched_ns

    @property
    def watched_s(self) -> float:
        """How long the topic was observed."""
        return (self.recording.stop_ns - self.begin_ns) / NS

    @property
    def seen(self) -> str:
        """The symptom in words."""
        number = counted(len(self.recording.on(self.topic)), "message")
        return f"{number} on {code(self.topic)} in {format_duration(self.watched_s)}"

    @property
    def moments(self) -> tuple[Moment, ...]:
        """When the first messages came."""
        return tuple(
            Moment(f"message {index}", self.recording.since_launch_s(message.stamp_ns))
            for index, message in enumerate(self.recording.on(self.topic)[:10], start=1)
        )


def why_few(recording: Recording, topic: str, needed: int) -> Cause:
    """Why fewer messages than needed were recorded on a topic."""
    if not recording.on(topic):
        return why_silent(recording, topic)
    return cause_of(FewMessages(recording, topic, needed))


@explanation(FewMessages)
def some_unreadable(symptom: FewMessages) -> Cause | None:
    """Some of what the program publishes is no message of the type."""
    return why_unreadable(symptom.recording, symptom.topic)


@explanation(FewMessages)
def process_ended_early(symptom: FewMessages) -> Cause | None:
    """The process ended before it published enough."""
    return why_ended(symptom.recording, symptom.seen)


@explanation(FewMessages)
def too_little_cpu_time(symptom: FewMessages) -> Cause | None:
    """With the time that the machine took from the process, it may have published enough."""
    recording, number = symptom.recording, len(symptom.recording.on(symptom.topic))
    stolen_s = recording.stolen_s(symptom.begin_ns, recording.stop_ns)
    left_to_it_s = symptom.watched_s - stolen_s
    if stolen_s <= 0.0 or number * symptom.watched_s < symptom.needed * left_to_it_s:
        return None
    return Cause.to_repeat(
        f"{symptom.seen}, but the machine took {format_duration(stolen_s)} of them from the process"
    )


@explanation(FewMessages)
def publisher_destroyed_early(symptom: FewMessages) -> Cause | None:
    """The program destroyed its publisher too early."""
    return why_unpublished(symptom.recording, symptom.topic, symptom.seen)


@explanation(FewMessages)
def timer_not_spun(symptom: FewMessages) -> Cause | None:
    """A timer was created, but rclpy.spin() is never called."""
    if not declarations.timers(symptom.recording):
        return None
    return why_never_spun(symptom.recording, symptom.seen, moments=symptom.moments)


@explanation(FewMessages, general=True)
def timer_stopped_or_slow(symptom: FewMessages) -> Cause | None:
    """A timer stopped, or its period is too long for as many messages."""
    recording, seen = symptom.recording, symptom.seen
    period_s = [timer.period_s for timer in declarations.timers(recording)]
    if not period_s:
        return None
    timers = f"; the process declared a timer of {listing(map(format_duration, period_s))}"
    silent_s = (recording.stop_ns - recording.on(symptom.topic)[-1].stamp_ns) / NS
    evidence = Evidence(moments=symptom.moments)
    if silent_s > _ENDED_PERIODS * max(period_s):
        return Cause(
            f"{seen}, none in the last {format_duration(silent_s)}{timers}", ENDED_HINT, evidence
        )
    is_slow = symptom.needed * min(period_s) > symptom.watched_s
    return Cause(seen + timers, SECONDS_HINT if is_slow else ENDED_HINT, evidence)


@explanation(FewMessages, general=True)
def publishing_stopped(symptom: FewMessages) -> Cause:
    """The program publishes without a timer, and stops."""
    return Cause(
        symptom.seen,
        "Publish from the callback of a timer, which goes on as long as the node spins.",
        Evidence(moments=symptom.moments),
    )
