"""The check of a timer: whether its callback publishes, or a thread or a loop does."""

from __future__ import annotations

from pydantic import Field

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.checks.need import Doubt
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.no_messages import why_silent
from grader.diagnosis.process.not_called import Uncalled, never_spun
from grader.diagnosis.undeclared import why_undeclared
from grader.findings.finding import Evidence, Finding, evidence_at, first_seen
from grader.findings.words import SPIN_NODE, code, counted
from grader.measure import callback_runs, declarations
from grader.measure.declarations import DeclaredTimer, was_held_up
from grader.measure.paused import Paused, paused, publishers
from grader.recording.model import Recording
from grader.spec.name import TopicName
from grader.spec.unit import format_duration

# How the tracer names a callback that is None: create_rate() makes a timer that calls nothing.
_NO_CALLBACK = "NoneType"
_CALLED_NOTHING = "rosgrade let the executor call nothing"


class Timer(Parameters):
    """Parameters of executor.timer."""

    about = ("timer", "publisher")
    doubt = Doubt.ANSWER_MISSED
    pauses = True

    asks = "a timer whose callback publishes on `{self.topic}`"

    topic: TopicName = Field(description="Topic on which the callback of a timer publishes.")


@check("executor.timer", Subject.RECORDING, Timer, concept="timers")
def timer(recording: Recording, parameters: Timer) -> Finding:
    """The process has a timer.

    A thread that sleeps and publishes looks like a timer. So, for a moment after the run, the
    executors find nothing ready and call no callback. If a message is published in this moment, it
    does not come from a callback, whatever the process declares. The process must also have
    declared its publisher and a timer with a callback, of any period.
    """
    topic = parameters.topic
    if not recording.on(topic):
        return why_silent(recording, topic)
    if not declarations.declares(recording, "publisher", topic=topic):
        return why_undeclared(recording, f"the publisher on {code(topic)}")
    timers = declarations.timers(recording)
    calling = [timer for timer in timers if timer.callback != _NO_CALLBACK]
    if calling and recording.pauses:
        stop_if(_why_no_callback_publishes(recording, topic))
    if declarations.not_in_callback(recording, topic):
        why = "outside of every callback: a thread or a loop calls publish()"
        return _no_timer(recording, topic, why)
    if calling:
        return _has_timer(recording, topic, calling[0])
    if declarations.timer_of_zero(recording):
        return Finding.as_asked("the process declared a timer")
    rate = " but that of a rate, which calls nothing" if timers else ""
    return _no_timer(
        recording,
        topic,
        f"but the process declared no timer{rate}: something else calls publish(), such as a "
        "thread or a loop",
    )


def _no_timer(recording: Recording, topic: str, why: str) -> Finding:
    messages = recording.on(topic)
    published = f"{counted(len(messages), 'message was', 'messages were')} published"
    shown = Evidence(moments=first_seen(recording, messages))
    return mistaken("no_timer", f"{published}, {why}", shown)


def _has_timer(recording: Recording, topic: str, declared: DeclaredTimer) -> Finding:
    observed = f"the process declared a timer of {format_duration(declared.period_s)}"
    if declared.callback:
        observed += f", which calls {code(declared.callback)}"
    if recording.pauses and publishers(recording, topic):
        observed += f", and nothing was published while {_CALLED_NOTHING}"
    return Finding.as_asked(observed, evidence_at(recording, "timer created", declared.declared_ns))


def _why_no_callback_publishes(recording: Recording, topic: str) -> Finding | None:
    """Why a callback does not publish, or why that is not known; None where one does."""
    pause = paused(recording, topic)
    if pause is not None and pause.uncalled_ns:
        return _published_in_pause(recording, pause)
    if pause is not None:
        return _why_pause_too_short(recording, topic, pause)
    if publishers(recording, topic):
        return _why_not_paused(recording, topic)
    return _why_ended_before_pause(recording, topic)


def _published_in_pause(recording: Recording, pause: Paused) -> Finding:
    number = counted(len(pause.uncalled_ns), "message was", "messages were")
    observed = f"{number} published outside of every callback, while {_CALLED_NOTHING}"
    if pause.is_doubtful(recording):
        return Finding.undecided(f"{observed}, but the machine held messages up")
    label = "published outside of every callback"
    shown = evidence_at(recording, label, pause.uncalled_ns[0])
    return mistaken("no_timer", f"{observed}: a thread or a loop calls publish()", shown)


def _why_pause_too_short(recording: Recording, topic: str, pause: Paused) -> Finding | None:
    """That a loop could have been silent in the pause by chance; None if it could not."""
    if pause.covers(recording, topic) or callback_runs.publishes(recording, topic):
        return None
    return Finding.ours(
        f"the messages on {code(topic)} are too far apart to see in the pause after the run "
        "whether a callback publishes them",
        disturbed=was_held_up(recording),
    )


def _why_ended_before_pause(recording: Recording, topic: str) -> Finding | None:
    """Why a program that ended with the run is not judged; None if its callbacks were timed."""
    observed = "the program ended"
    not_spun = _why_never_spun(recording, topic, observed)
    if not_spun is not None:
        return not_spun
    if callback_runs.publishes(recording, topic):
        return None
    return Finding.ours(
        f"{observed} before it could be judged whether a callback publishes",
        f"Let {SPIN_NODE} run until Ctrl+C ends it.",
    )


def _why_not_paused(recording: Recording, topic: str) -> Finding:
    """Why the executor of a running program did not pause."""
    observed = "after the run no executor of the process waited for work when it was asked to"
    not_spun = _why_never_spun(recording, topic, observed)
    if not_spun is not None:
        return not_spun
    if not declarations.declares(recording, "spin"):
        return Finding.ours(f"{observed}: rosgrade does not know its kind")
    shown = Evidence(moments=first_seen(recording, recording.on(topic)))
    return mistaken("never_waits", observed, shown).doubted(was_held_up(recording))


def _why_never_spun(recording: Recording, topic: str, observed: str) -> Finding | None:
    """That a program in Python which publishes on the topic never spun, or None."""
    names = {
        publisher.process
        for publisher in recording.declared("publisher")
        if publisher.data.get("topic") == topic
        and not declarations.is_compiled(recording, publisher.process)
    }
    # A process that declares a run of a callback has spun, in an executor of a kind of its own.
    processes = [
        process
        for process in recording.processes
        if process.name in names and not declarations.declares(recording, "ran", process.name)
    ]
    return never_spun(Uncalled(recording, observed, (), processes))
