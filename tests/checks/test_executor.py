"""executor.responsive: a callback may be busy, but must come back."""

from dataclasses import replace

import pytest

from grader.findings.finding import Status
from grader.recording.interaction import Service
from grader.recording.model import Ending, Kind, Owner
from tests.checks.builder import (
    NODE,
    at,
    call,
    calls,
    declarations,
    declared,
    died,
    endpoint,
    failing,
    judge,
    node,
    nodeless,
    output,
    reader,
    recording,
    taken,
    traceback,
)

OFFERED = Service(f"{NODE}/list_parameters", "rcl_interfaces/srv/ListParameters", NODE, 0)
LOOPING = {"calls": calls(None), "declarations": declarations(timer_s=None, spin=False)}


def responsive(run, **parameters):
    return judge("executor.responsive", run, **parameters)


class TestGood:
    def test_a_node_that_answers_at_once_passes(self):
        finding = responsive(recording())
        assert finding.status is Status.PASSED
        assert finding.observed == "`/bot_publisher` answered 8 of 8 calls within 1 s"
        assert finding.evidence.plots[0].y == pytest.approx([0.002] * 8)

    def test_a_callback_that_sleeps_most_of_its_period(self):
        assert responsive(recording(calls=calls(0.25))).status is Status.PASSED

    def test_a_slow_constructor_before_the_first_message(self):
        early = (call(0.1, None), call(0.3, 2.0), call(0.6, None))
        run = recording(calls=(*early, *calls()))
        assert responsive(run).status is Status.PASSED

    def test_a_node_that_publishes_nothing_counts_from_when_it_spins(self):
        waits = tuple(call(0.5 * n, 3.1 - 0.5 * n if n < 7 else 0.002) for n in range(1, 9))
        quiet = {"messages": {}, "endpoints": ()}
        for spin_s, calls_, status in (
            (3.1, waits, Status.PASSED),
            (0.4, waits, Status.FAILED),
            # The word of a process that never answers counts for nothing.
            (3.1, calls(None), Status.FAILED),
        ):
            traced = (declared("started"), declared("spin", spin_s))
            run = recording(calls=calls_, declarations=traced, **quiet)
            assert responsive(run).status is status

    def test_a_call_too_late_to_be_answered_before_the_end(self):
        run = recording(calls=(*calls(), call(4.2, None)))
        assert responsive(run).status is Status.PASSED

    def test_one_late_answer_of_many(self):
        run = recording(calls=(*calls(), call(2.2, 1.5)))
        assert responsive(run).status is Status.PASSED

    def test_a_node_without_parameter_services_is_judged_by_another_one(self):
        asked = tuple(
            replace(item, service="/bot_publisher/get_type_description") for item in calls(0.01)
        )
        assert responsive(recording(calls=asked)).status is Status.PASSED
        never = tuple(replace(item, answered_ns=None) for item in asked)
        found = failing("executor.responsive", recording(calls=never))
        assert "answered 0 of 6 calls within 1 s" in found

    def test_a_node_that_nothing_could_be_asked_of_is_judged_by_what_it_declares(self):
        finding = responsive(recording(calls=(), services=(OFFERED,)))
        assert finding.status is Status.PASSED
        assert "the process declared a timer and that its executor spins" in finding.observed

    def test_declarations_are_no_proof_where_a_process_left_nothing_to_call(self):
        unasked = recording(calls=())
        assert "has none of the services" in failing("executor.responsive", unasked)
        # Of what a busy machine loses nothing is known.
        busy = replace(unasked, disturbance=taken(0.1, 1.0, waited_s=0.6))
        assert (responsive(busy).status, responsive(busy).disturbed) == (Status.ERROR, True)

    def test_every_node_of_one_name_must_answer(self):
        twins = [replace(item, servers=2) for item in calls()]
        assert responsive(recording(calls=tuple(twins))).status is Status.PASSED
        silent_one = tuple(replace(item, answered_ns=None) for item in twins)
        found = failing("executor.responsive", recording(calls=silent_one))
        assert "answered 0 of 6 calls" in found

    def test_another_node_cannot_answer_in_its_place(self):
        helper = replace(OFFERED, node="/helper")
        found = failing("executor.responsive", recording(services=(helper,)))
        assert "`/bot_publisher` has none of the services" in found

    def test_a_second_node_without_a_spin_that_is_not_on_the_topic(self):
        settings = "/settings"
        run = recording(
            nodes=(node(), node(settings)),
            calls=(*calls(), *(call(t, None, of=settings) for t in (1.0, 1.5, 2.0, 2.5))),
        )
        assert responsive(run).status is Status.PASSED

    def test_the_node_of_a_transform_listener_in_cpp_which_answers_nothing(self):
        listener = "/transform_listener_impl_55d0ac2bf090"
        ends = [endpoint("/tf", kind=Kind.SUBSCRIPTION, node=listener)]
        run = recording(nodes=(node(), node(listener)), messages={})
        unanswered = (call(t, None, of=listener) for t in (1.0, 1.5, 2.0, 2.5))
        for more in ((), (endpoint("/tf", owner=Owner.PROBE),)):
            seen = replace(run, endpoints=(*ends, *more), calls=(*run.calls, *unanswered))
            assert responsive(seen).status is Status.PASSED

    def test_a_node_that_publishes_nothing_is_judged_from_its_appearance(self):
        run = recording(messages={}, endpoints=(reader(),))
        assert responsive(run).status is Status.PASSED


class TestMostlyBusy:
    BUSY = tuple(call(0.6 + 0.5 * number, wait_s) for number, wait_s in
                 enumerate([0.25, 0.05, 0.15, 0.25, 0.05, 0.15]))  # fmt: skip

    def test_a_publisher_that_was_held_in_vain_is_not_the_students_doing(self):
        while_held = (call(0.9, 1.5), call(1.1, 1.3), call(1.3, 1.1))
        silent_run = recording(messages={}, calls=(*while_held, *calls()))
        assert responsive(silent_run).status is Status.FAILED
        held = declared("held", 2.4, topic="/cmd_vel", waited_s=2.0, matched=False)
        run = replace(silent_run, declarations=(*silent_run.declarations, held))
        assert responsive(run).status is Status.PASSED
        # No publisher is held for so long.
        lying = replace(run, declarations=(*silent_run.declarations, replace(held, time_ns=at(4))))
        assert responsive(lying).status is Status.FAILED

    def test_answers_in_time_that_are_mostly_late(self):
        run = recording(calls=self.BUSY)
        assert responsive(run).status is Status.PASSED
        found = failing("executor.responsive", run, typically="100 ms")
        assert "answered after 150 ms (median): callbacks keep the executor busy" in found
        assert "no time.sleep() in it" in found

    def test_a_few_late_answers_do_not_matter(self):
        waits_s = [0.25, 0.002, 0.003, 0.25, 0.002, 0.002]
        quick = tuple(call(0.6 + 0.5 * number, wait_s) for number, wait_s in enumerate(waits_s))
        run = recording(calls=quick)
        assert judge("executor.responsive", run, typically="100 ms").status is Status.PASSED

    def test_a_busy_machine_is_not_a_busy_callback(self):
        run = recording(calls=self.BUSY, disturbance=taken(0.6, 4.0, waited_s=1.5))
        finding = judge("executor.responsive", run, typically="100 ms")
        assert (finding.status, finding.disturbed) == (Status.ERROR, True)


class TestBlocked:
    def test_a_loop_that_never_spins(self):
        found = failing("executor.responsive", recording(**LOOPING))
        assert "answered 0 of 6 calls within 1 s" in found
        assert "while 12 messages were published" in found
        assert "rclpy.spin() was never called" in found
        assert "Nothing before it may wait or loop for ever" in found

    def test_the_line_of_the_loop_is_named(self):
        log = output(traceback("KeyboardInterrupt", source="time.sleep(0.3)", line=17))
        finding = responsive(recording(**LOOPING, log=log))
        assert "it is in line 17, `time.sleep(0.3)`, when it was stopped" in finding.observed
        assert finding.evidence.places[0].line == 17

    def test_a_node_that_no_executor_has(self):
        spin = declared("spin", executor="SingleThreadedExecutor", threads=1, tells_added=True)
        traced = (*declarations(spin=False), spin)
        found = failing("executor.responsive", recording(calls=calls(None), declarations=traced))
        assert ": an executor spins, but" in found
        assert "`/bot_publisher` was not added to it" in found

    def test_a_loop_in_a_callback(self):
        found = failing("executor.responsive", recording(calls=calls(None)))
        assert "something blocks the executor" in found
        assert "never called" not in found

    def test_a_node_in_spin_when_it_was_interrupted_is_not_blamed_for_that_line(self):
        log = output(traceback("KeyboardInterrupt", source="rclpy.spin(node)", line=30))
        finding = responsive(recording(calls=calls(None), log=log))
        assert finding.status is Status.FAILED
        assert finding.evidence.places == ()

    def test_a_death_is_the_deeper_cause(self):
        run = recording(
            calls=(call(0.8), call(1.3, None), call(1.8, None), call(2.3, None)),
            processes=(died(1, 1.2),),
            log=output(traceback("KeyError: 'x'")),
        )
        assert "KeyError: 'x'" in failing("executor.responsive", run)

    def test_the_only_call_must_be_answered(self):
        run = recording(calls=(call(1.0, None),))
        assert responsive(run).status is Status.FAILED

    def test_every_node_on_the_topic_counts(self):
        twin = "/twin"
        run = recording(
            nodes=(node(), node(twin)),
            endpoints=(endpoint(), endpoint(node=twin), reader()),
            calls=(*calls(), *(call(t, None, of=twin) for t in (1.0, 1.5, 2.0, 2.5))),
        )
        assert "`/twin` answered 0 of 4" in failing("executor.responsive", run)

    def test_every_node_counts_if_none_is_on_the_topic(self):
        twin = "/twin"
        run = recording(
            messages={},
            nodes=(node(), node(twin)),
            endpoints=(endpoint("/elsewhere"), reader()),
            calls=(*calls(), *(call(t, None, of=twin) for t in (1.0, 1.5, 2.0, 2.5))),
        )
        assert "`/twin` answered 0 of 4" in failing("executor.responsive", run)

    def test_without_a_node_that_is_the_cause(self):
        run = nodeless(processes=(died(-11),), ending=Ending.EXITED)
        assert "SIGSEGV" in failing("executor.responsive", run)


class TestNotJudged:
    def test_a_busy_machine_is_never_blamed_on_the_node(self):
        slow = recording(calls=calls(1.4), disturbance=taken(0.5, 4.4, waited_s=0.5))
        finding = responsive(slow)
        assert (finding.status, finding.disturbed) == (Status.ERROR, True)

    def test_a_busy_machine_does_not_excuse_a_loop(self):
        noise = taken(0.5, 4.4, waited_s=0.4)
        assert responsive(recording(**LOOPING, disturbance=noise)).status is Status.FAILED

    def test_no_call_and_nothing_declared(self):
        finding = responsive(
            recording(calls=(), declarations=(declared("started"),), services=(OFFERED,))
        )
        assert (finding.status, finding.disturbed) == (Status.ERROR, False)
        assert f"`{NODE}/list_parameters`" in finding.observed
