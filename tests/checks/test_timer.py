"""executor.timer: only the process can tell whether a timer or a sleeping loop publishes."""

import pytest

from grader.findings.finding import Status
from tests.checks.builder import (
    NODE,
    declarations,
    declared,
    failing,
    judge,
    package,
    recording,
    submission,
)

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


@pytest.mark.parametrize("traced", [(), declarations()[:1], (*declarations()[:1], timer(0.3))])
def test_a_process_that_shut_the_tracer_out_is_named(traced):
    found = failing("executor.timer", recording(declarations=traced), **ASKED)
    assert "the process did not declare the publisher on `/cmd_vel`" in found


COMPILED = submission(package(build_type="ament_cmake"))


@pytest.mark.parametrize("recorded", [{}, {"compiled_tracer": "lacking"}])
def test_a_compiled_program_declares_nothing_where_there_is_no_tracer_for_it(recorded):
    run = recording(declarations=(), submission=COMPILED, environment=recorded)
    assert judge("executor.timer", run, **ASKED).status is Status.ERROR


@pytest.mark.parametrize("tracer", ["preloaded", "none"])
def test_a_compiled_program_that_hides_from_its_tracer_earns_nothing(tracer):
    recorded = {"compiled_tracer": tracer}
    run = recording(declarations=(), submission=COMPILED, environment=recorded)
    assert "did not declare the publisher" in failing("executor.timer", run, **ASKED)


def test_a_timer_beside_the_thread_that_publishes_earns_nothing():
    traced = [declared("published", 1.0, topic="/cmd_vel", number=1, in_callback=True)]
    traced.append(declared("published", 1.3, topic="/cmd_vel", number=2, in_callback=False))
    found = failing("executor.timer", loop(timer(0.3), *traced), **ASKED)
    assert "outside of every callback: a thread or a loop calls publish()" in found
    first_in_constructor = loop(timer(0.3), *traced[::-1])
    assert judge("executor.timer", first_in_constructor, **ASKED).status is Status.PASSED
    at_the_end = declared("published", 4.55, topic="/cmd_vel", number=4, in_callback=False)
    stopped = loop(timer(0.3), *traced[::-1], at_the_end)
    assert judge("executor.timer", stopped, **ASKED).status is Status.PASSED
    events = declared("spin", 0.5, executor="EventsExecutor", threads=1)
    run = loop(timer(0.3), *traced, events)
    assert judge("executor.timer", run, **ASKED).status is Status.PASSED
