"""What the student's code destroyed is a finding, by name; what the scenario ended is not."""

from dataclasses import replace

from grader.findings.finding import Status
from grader.recording.event import Intervention
from grader.recording.model import Kind
from tests.checks.builder import (
    BOT,
    LAUNCH_NS,
    RELIABLE,
    at,
    died,
    endpoint,
    every,
    failing,
    join,
    judge,
    messages,
    reader,
    recording,
    sent,
    stimulus,
    taken,
)

LATCHED = replace(RELIABLE, durability="transient_local")
LISTENER = endpoint("/chatter", kind=Kind.SUBSCRIPTION, type="std_msgs/msg/String")
LATENCY = {"stimulus": "/chatter", "topic": "/cmd_vel", "most": "100 ms"}
LOGGED = {"topic": "/chatter", "fields": ["data"], "at_least": 2, "sent": "after_launch"}
FIRST_TEN = sent(every(-0.5 / 10, 10, -0.1))
WORDS = "was destroyed 0.90 s after launch, while the process still ran"


def gone(item, time_s=0.9):
    """What vanished at a time."""
    return replace(item, vanished_ns=at(time_s))


def deaf(**changes):
    """A run in which the subscription to /chatter was destroyed."""
    return recording(**{"endpoints": (gone(LISTENER), endpoint(), reader(), stimulus()), **changes})


def test_a_subscription_that_was_destroyed_after_the_first_messages():
    # At any load: what was sent after it cannot have been answered.
    slow = taken(0.5, 2.6, waited_s=1.0)
    run = deaf(
        sent=sent(every(0.1, 20, 0.5)), messages=messages(every(0.1, 4, 0.51)), disturbance=slow
    )
    assert f"the subscription to `/chatter` {WORDS}" in failing("timing.latency", run, **LATENCY)


def test_a_subscription_that_was_destroyed_after_what_was_sent_before_the_launch():
    found = failing("log.follows", deaf(sent=FIRST_TEN), **LOGGED)
    assert f"the subscription to `/chatter` {WORDS}" in found


def test_a_publisher_that_was_destroyed_before_a_late_joiner():
    run = recording(
        endpoints=(gone(endpoint(qos=LATCHED), 4.0), reader()),
        joins=(replace(join(4.2), matched_ns=None),),
        joined={"late": ()},
    )
    found = failing("qos.late_joiner", run, topic="/cmd_vel", joiner="late", last=5)
    assert "the publisher on `/cmd_vel` was destroyed 4.00 s after launch" in found


def test_what_vanished_with_its_process_was_not_destroyed():
    run = deaf(sent={"/chatter": ()}, processes=(died(-11, 0.9),))
    found = failing("timing.latency", replace(run, messages={}), **LATENCY)
    assert "SIGSEGV" in found
    assert "while the process still ran" not in found


def test_what_the_scenario_ended_was_not_destroyed():
    killed = Intervention(at(0.8), BOT, "kill", "SIGINT")
    finding = judge(
        "timing.latency", deaf(sent={"/chatter": ()}, interventions=(killed,)), **LATENCY
    )
    assert finding.status is Status.ERROR


def test_what_is_there_was_not_destroyed():
    ends = (gone(LISTENER), LISTENER, endpoint(), reader(), stimulus())
    run = deaf(sent={"/chatter": ()}, endpoints=ends)
    assert (ends[0].vanished_ns or 0) > LAUNCH_NS
    assert judge("timing.latency", run, **LATENCY).status is Status.ERROR
