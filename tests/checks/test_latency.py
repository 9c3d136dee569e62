"""timing.latency."""

from hypothesis import given
from hypothesis import strategies as st

from grader.checks.timing.latency import answers_to
from grader.findings.finding import Status
from grader.recording.model import Kind
from tests.checks.builder import (
    endpoint,
    every,
    failing,
    judge,
    message,
    messages,
    recording,
    sent,
    taken,
)

QUESTIONS_S = every(0.3, 10)
LISTENER = endpoint("/chatter", kind=Kind.SUBSCRIPTION, type="std_msgs/msg/String")


def answered(latencies_s, **changes):
    """A node that answers what it is sent on /chatter on /cmd_vel, so much later."""
    times = [q + latency for q, latency in zip(QUESTIONS_S, latencies_s, strict=False)]
    return recording(
        **{
            "messages": messages(times),
            "sent": sent(QUESTIONS_S),
            "answers": {"/chatter": "/cmd_vel"},
            **changes,
        }
    )


def latency(**limits):
    return {"stimulus": "/chatter", "topic": "/cmd_vel", **limits}


def test_answers_that_come_soon_enough_pass():
    finding = judge(
        "timing.latency", answered([0.01] * 10), **latency(median="20 ms", most="0.1 s")
    )
    assert finding.status is Status.PASSED
    assert finding.observed == "median 10 ms, largest 10 ms, over 10 answers"
    assert finding.evidence.plots[0].band == (0.0, 100.0)


def test_the_median_is_too_long():
    found = failing("timing.latency", answered([0.05] * 10), **latency(median="20 ms"))
    assert "median 50 ms" in found
    assert "in the subscription's callback itself" in found


def test_one_slow_answer_does_not_move_the_median():
    times = [0.01] * 9 + [0.2]
    run = answered(times)
    assert judge("timing.latency", run, **latency(median="20 ms")).status is Status.PASSED
    assert "largest 200 ms" in failing("timing.latency", run, **latency(most="0.1 s"))


def test_a_message_without_an_answer():
    times = [q + 0.01 for n, q in enumerate(QUESTIONS_S) if n != 4]
    run = answered([], messages=messages(times))
    found = failing("timing.latency", run, **latency(median="20 ms", within="200 ms"))
    assert "1 of 10 messages on `/chatter` had no answer within 200 ms" in found
    allowed = latency(median="20 ms", within="200 ms", unanswered=1)
    assert judge("timing.latency", run, **allowed).status is Status.PASSED


def test_what_the_machine_took_costs_no_point():
    late = [0.01] * 9 + [0.2]
    run = answered(late, disturbance=taken(3.4, 3.6, waited_s=0.19))
    finding = judge("timing.latency", run, **latency(most="50 ms"))
    assert finding.status is Status.ERROR
    assert finding.disturbed


@given(st.lists(st.floats(0.0, 0.5), min_size=1, max_size=20))
def test_every_answer_within_the_pace_is_paired_with_its_question(delays):
    asked = [message(float(n)) for n in range(len(delays))]
    answers = [message(n + delay) for n, delay in enumerate(delays)]
    assert answers_to(asked, answers, 600_000_000) == answers
