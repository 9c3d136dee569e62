"""timing.rate."""

import pytest

from grader.checks.finding import Status
from tests.checks.builder import (
    declarations,
    every,
    failing,
    judge,
    message,
    messages,
    recording,
    silent,
    taken,
)


def at_rate(period_s, count=20, **changes):
    return recording(messages=messages(every(period_s, count)), stop_s=12.0, **changes)


def test_within_the_bounds():
    finding = judge("timing.rate", at_rate(0.1), topic="/cmd_vel", at_least="9 Hz", at_most="11 Hz")
    assert finding.status is Status.PASSED
    assert finding.expected == "at least 9 Hz and at most 11 Hz on `/cmd_vel`"
    assert finding.observed == "10 Hz: 20 messages in 1.9 s"


def test_too_slow():
    found = failing("timing.rate", at_rate(0.2), topic="/cmd_vel", at_least="9 Hz")
    assert "5 Hz: 20 messages in 3.8 s" in found
    assert "seconds: the reciprocal of the rate" in found


def test_too_fast():
    found = failing("timing.rate", at_rate(0.05), topic="/cmd_vel", at_most="11 Hz")
    assert "20 Hz" in found
    assert "second timer" in found


def test_a_message_that_was_lost_on_its_way_counts():
    kept = [message(0.7 + 0.1 * n, sequence=n + 1) for n in range(20) if n % 2 == 0 or n == 19]
    run = recording(messages={"/cmd_vel": tuple(kept)})
    finding = judge("timing.rate", run, topic="/cmd_vel", at_least="9 Hz")
    assert finding.status is Status.PASSED


def test_what_the_machine_took_costs_no_point():
    run = at_rate(0.2, disturbance=taken(0.7, 4.0, waited_s=2.5))
    finding = judge("timing.rate", run, topic="/cmd_vel", at_least="9 Hz")
    assert finding.status is Status.ERROR and finding.disturbed


def test_silence_is_told_as_such():
    run = silent(declarations=declarations(timer_s=300.0))
    assert "timer of 5 min" in failing("timing.rate", run, topic="/cmd_vel", at_least="9 Hz")


@pytest.mark.parametrize(
    ("bounds", "words"),
    [({}, "give a bound"), ({"at_least": "9 Hz", "at_most": "1 Hz"}, "more than at_most")],
)
def test_senseless_bounds_are_refused(bounds, words):
    with pytest.raises(ValueError, match=words):
        judge("timing.rate", at_rate(0.1), topic="/cmd_vel", **bounds)
