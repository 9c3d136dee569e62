"""executor.timer: only the process can tell whether a timer or a sleeping loop publishes."""

from dataclasses import replace

import pytest

from grader.findings.finding import Status
from grader.recording.event import Pause
from tests.checks.builder import (
    NODE,
    at,
    declarations,
    declared,
    died,
    failing,
    judge,
    messages,
    package,
    process,
    recording,
    submission,
    taken,
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


def after_the_run(times_s=(), *more, paused_s=4.6, **changes):
    """A run of a timer, then a pause until 5.6 s in which messages are received."""
    told = tuple(replace(one, data={**one.data, "pid": 1}) for one in declarations())
    paused = (declared("paused", paused_s, pid=1),) if paused_s else ()
    pause = Pause(at(4.5), at(5.6), {"/cmd_vel": tuple(map(at, times_s))})
    run = recording(declarations=(*told, *paused, *more), pauses=(pause,))
    return replace(run, **changes)


def test_what_comes_while_executors_pause_is_published_by_something_else():
    found = failing("executor.timer", after_the_run([5.1, 5.4]), **ASKED)
    assert "2 messages were published outside of every callback" in found
    silent = judge("executor.timer", after_the_run(), **ASKED)
    assert silent.status is Status.PASSED
    assert silent.observed.endswith("while rosgrade let the executor call nothing")


def test_a_callback_that_had_begun_may_still_publish():
    assert judge("executor.timer", after_the_run([4.7, 4.95]), **ASKED).status is Status.PASSED


def test_what_a_process_declares_helps_nothing_that_publishes_in_the_pause():
    forged = declared("published", 1.0, topic="/cmd_vel", number=1, in_callback=True, pid=1)
    early = declared("paused", 1.0, pid=1)
    assert "outside of every" in failing("executor.timer", after_the_run([5.3], forged), **ASKED)
    run = after_the_run([5.3], early, paused_s=None)
    assert "waited for work when it was asked to" in failing("executor.timer", run, **ASKED)


def test_the_machine_may_hold_a_message_up():
    slow = taken(4.5, 5.5, waited_s=0.6)
    finding = judge("executor.timer", after_the_run([5.1], disturbance=slow), **ASKED)
    assert (finding.status, finding.disturbed) == (Status.ERROR, True)


def never_spun(run):
    return replace(run, declarations=tuple(one for one in run.declarations if one.kind != "spin"))


@pytest.mark.parametrize(
    ("more", "changes"),
    [((), {"submission": COMPILED}), ((declared("started", 0.05, language="C++"),), {})],
)
def test_a_compiled_executor_of_an_unknown_kind_is_no_fault_of_the_program(more, changes):
    run = never_spun(after_the_run((), *more, paused_s=None))
    told = tuple(one for one in run.declarations if more or one.kind != "started")
    run = replace(run, declarations=told, **changes)
    assert judge("executor.timer", run, **ASKED).status is Status.ERROR


def test_an_executor_in_python_that_rosgrade_does_not_know_is_none_either():
    run = never_spun(after_the_run((), ran(1.0), paused_s=None))
    assert judge("executor.timer", run, **ASKED).status is Status.ERROR


def test_an_unused_timer_of_a_program_that_never_spins_earns_nothing():
    found = failing("executor.timer", never_spun(after_the_run(paused_s=None)), **ASKED)
    assert "rclpy.spin() was never called" in found


def ran(began_s, lasted_s=0.01, callback="tick"):
    times = {"began_ns": at(began_s), "ended_ns": at(began_s + lasted_s)}
    return declared("ran", began_s, callback=callback, serves="0.3 s", pid=1, **times)


def ended(*more):
    """A run of a program that ended by itself, so no executor paused."""
    pause = Pause(at(4.5), at(4.5))
    return after_the_run((), *more, paused_s=None, processes=(died(0, 4.4),), pauses=(pause,))


def test_a_program_that_ends_by_itself_and_never_spins_earns_nothing():
    found = failing("executor.timer", never_spun(ended()), **ASKED)
    assert "the program ended: rclpy.spin() was never called" in found


def test_a_program_that_ends_by_itself_passes_where_its_callback_published():
    run = ended(*(ran(began_s) for began_s in (0.695, 0.995, 1.595)))
    finding = judge("executor.timer", run, **ASKED)
    assert finding.status is Status.PASSED and "let the executor" not in finding.observed


@pytest.mark.parametrize("runs", [(), (1.1, 2.05, 2.495)])
def test_a_program_that_ends_by_itself_does_not_pass_on_what_it_declares(runs):
    finding = judge("executor.timer", ended(*map(ran, runs)), **ASKED)
    assert finding.status is Status.ERROR
    assert "ended before it could be judged whether a callback publishes" in finding.observed


def test_a_pause_that_is_too_short_for_the_rhythm_proves_nothing():
    slow = {"messages": messages([0.7, 1.7, 2.7, 3.7])}
    finding = judge("executor.timer", after_the_run(**slow), **ASKED)
    assert finding.status is Status.ERROR and "too far apart" in finding.observed
    called = after_the_run((), ran(0.695), ran(1.695), **slow)
    assert judge("executor.timer", called, **ASKED).status is Status.PASSED


def test_only_the_newest_of_a_process_that_was_started_again_must_pause():
    before = declared("publisher", 0.1, topic="/cmd_vel", depth=10, pid=7)
    run = after_the_run()
    run = replace(run, declarations=(before, declared("spin", 0.2, pid=7), *run.declarations))
    assert judge("executor.timer", run, **ASKED).status is Status.PASSED


@pytest.mark.parametrize(
    ("ended", "processes"),
    [
        (declared("destroyed", 1.0, "helper/helper", number=9, pid=7), ()),
        (declared("exiting", 1.0, "helper/helper", pid=7), ()),
        (declared("exiting", 1.0, pid=7), ()),
        (None, (died(-9, 1.0, "helper/helper"),)),
    ],
)
def test_a_helper_that_ended_before_the_pause_need_not_pause(ended, processes):
    name = ended.process if ended else "helper/helper"
    about = {"topic": "/cmd_vel", "depth": 10, "number": 9, "pid": 7}
    helper = (declared("publisher", 0.6, name, **about), declared("spin", 0.7, name, pid=7))
    processes = (process(), *(processes or (process("helper/helper"),)))
    run = after_the_run((), *helper, *filter(None, [ended]), processes=processes)
    assert judge("executor.timer", run, **ASKED).status is Status.PASSED
    still = after_the_run((), *helper, processes=(process(), process(name)))
    assert "no executor of the process waited" in failing("executor.timer", still, **ASKED)
