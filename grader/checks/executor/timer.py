"""Check of what calls the code that publishes: a timer of the node, or a loop that sleeps."""

from __future__ import annotations

from pydantic import Field

from grader.checks.check import Parameters, Subject, check
from grader.checks.finding import Evidence, Finding, Moment
from grader.checks.first_seen import first_seen
from grader.checks.need import Doubt
from grader.checks.wording import code, counted
from grader.diagnosis.no_messages import why_silent
from grader.diagnosis.undeclared import why_undeclared
from grader.measure import declarations
from grader.recording.model import Recording
from grader.spec.name import TopicName
from grader.spec.unit import format_duration

# How the tracer names a callback that is None: create_rate() makes a timer that calls nothing.
_NOTHING = "NoneType"
_HINT = (
    "A thread or a loop that sleeps adds what its work takes to every period, and goes on where "
    "the executor has stopped. Create a timer in the constructor, "
    "self.timer = self.create_timer(period, self.callback) with the period in seconds, publish in "
    "its callback, and call rclpy.spin(node) in main()."
)


class Timer(Parameters):
    """Parameters of executor.timer."""

    doubt = Doubt.ANSWER_MISSED

    topic: TopicName = Field(description="Topic on which the callback of a timer publishes.")


@check("executor.timer", Subject.RECORDING, Timer)
def timer(recording: Recording, parameters: Timer) -> Finding:
    """The process has a timer.

    Messages of a thread that sleeps look like those of a timer, so this is judged by what the
    process declared: a process that created its publisher on the topic and no timer at all does
    not publish in the callback of one. Any timer with a callback will do, whatever its period.
    Where the process did not declare its publisher either, it is an error, which costs no point.
    """
    expected = f"a timer, in whose callback the node publishes on {code(parameters.topic)}"
    messages = recording.on(parameters.topic)
    if not messages:
        return why_silent(recording, parameters.topic).finding(expected)
    if not declarations.declares(recording, "publisher", "topic", parameters.topic):
        cause = why_undeclared(recording, f"the publisher on {code(parameters.topic)}")
        return cause.finding(expected)
    timers = declarations.timers(recording)
    calling = [item for item in timers if item.callback != _NOTHING]
    number = f"{counted(len(messages), 'message was', 'messages were')} published"
    if declarations.not_in_callback(recording, parameters.topic):
        observed = f"{number}, outside of every callback: a thread or a loop calls publish()"
    elif calling:
        name = f", which calls {code(calling[0].callback)}" if calling[0].callback else ""
        created_s = recording.since_launch_s(calling[0].declared_ns)
        return Finding.passed(
            expected,
            f"the process declared a timer of {format_duration(calling[0].period_s)}{name}",
            Evidence(moments=(Moment("timer created", created_s),)),
        )
    elif declarations.timer_of_zero(recording):
        return Finding.passed(expected, "the process declared a timer")
    else:
        rate = " but that of a rate, which calls nothing" if timers else ""
        observed = (
            f"{number}, but the process declared no timer{rate}: something else calls publish(), "
            "such as a thread or a loop"
        )
    evidence = Evidence(moments=first_seen(recording, messages))
    return Finding.failed(expected, observed, _HINT, evidence)
