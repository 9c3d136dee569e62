"""executor.timer: only the process can tell whether a timer or a sleeping loop publishes."""

import pytest

from grader.checks.finding import Status
from tests.checks.builder import NODE, declarations, declared, failing, judge, recording

ASKED = {"topic": "/cmd_vel"}


def timer(period_s, callback="BotPublisher.timer_callback"):
    return declared("timer", 0.4, node=NODE, period_s=period_s, callback=callback, group={})


def loop(*more):
    return recording(declarations=(*declarations(timer_s=None), *more))


def test_a_timer_that_calls_back():
    finding = judge("executor.timer", recording(), **ASKED)
    assert finding.status is Status.PASSED
    assert finding.observed == "the process declared a timer of 300 ms, which calls `f`"


@pytest.mark.parametrize("period_s", [0.0, 0.1, 1.0])
def test_its_period_is_judged_elsewhere(period_s):
    assert judge("executor.timer", loop(timer(period_s)), **ASKED).status is Status.PASSED


def test_a_thread_that_sleeps():
    found = failing("executor.timer", loop(), **ASKED)
    assert "the process declared no timer: something else calls publish()" in found
    assert "self.create_timer(period, self.callback)" in found


def test_a_rate_calls_nothing():
    found = failing("executor.timer", loop(timer(0.3, "NoneType")), **ASKED)
    assert "no timer but that of a rate, which calls nothing" in found


def test_a_process_that_declares_nothing_loses_no_point():
    finding = judge("executor.timer", recording(declarations=()), **ASKED)
    assert finding.status is Status.ERROR


def test_a_publisher_that_is_silent_is_told_why():
    found = failing("executor.timer", recording(messages={}), **ASKED)
    assert "/cmd_vel" in found
