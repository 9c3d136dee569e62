"""action.*: accepted or rejected, with feedback, a result, and an end before that."""

from dataclasses import replace

import pytest

from grader.checks.finding import Status
from grader.recording.model import Ending
from tests.checks.builder import (
    SOURCE,
    at,
    declared,
    died,
    failing,
    judge,
    output,
    taken,
    traceback,
)
from tests.checks.requests import FIBONACCI, acting, action, goal, service

FIB = {"action": "/fibonacci"}
RESULT = {**FIB, "result": {"sequence": [0, 1, 1, 2, 3]}, "within": "2 s"}
FEEDBACK = {**FIB, "at_least": 3, "rate": "10 Hz"}


def canceled(**changes):
    """A goal that was asked to cancel 0.2 s after it was accepted, and was 0.1 s later."""
    values = {
        "status": "canceled",
        "end_s": 0.31,
        "cancel_after_s": 0.2,
        "canceled_ns": at(1.21),
        "cancel_answered_ns": at(1.22),
        "cancel_accepted": True,
    }
    return goal(**{**values, **changes})


class TestExists:
    def test_by_name_and_type(self):
        assert judge("action.exists", acting(), **FIB, type=FIBONACCI).status is Status.PASSED

    def test_a_near_miss(self):
        run = acting(services=(action("/fibonaci"),))
        assert "offers the action `/fibonaci` instead of" in failing("action.exists", run, **FIB)

    def test_a_service_in_its_place(self):
        run = acting(services=(service("/fibonacci"),))
        assert "but has no action of that name" in failing("action.exists", run, **FIB)


class TestResult:
    def test_good(self):
        finding = judge("action.result", acting(goal()), **RESULT)
        assert finding.status is Status.PASSED
        assert finding.observed == "succeeded: sequence = [0, 1, 1, 2, 3]"

    def test_other_values(self):
        found = failing("action.result", acting(goal(sequence=(0, 1, 1, 2))), **RESULT)
        assert "sequence = [0, 1, 1, 2] instead of [0, 1, 1, 2, 3]" in found
        assert "sets `sequence`" in found

    def test_what_was_not_aborted_is_not_said_to_be(self):
        run = acting(goal(status="succeeded"))
        found = failing("action.result", run, **{**RESULT, "status": "aborted"})
        assert "goal_handle.abort()" in found and "rclpy aborts" not in found

    def test_rejected(self):
        found = failing("action.result", acting(goal(accepted=False)), **RESULT)
        assert "the goal (order = 4) was rejected" in found

    def test_aborted_without_succeed(self):
        found = failing("action.result", acting(goal(status="aborted")), **RESULT)
        assert "the goal (order = 4) aborted" in found and "goal_handle.succeed()" in found

    def test_an_exception_that_rclpy_caught_is_the_cause(self):
        log = output(traceback("IndexError: list index out of range"), time_s=1.2)
        run = acting(goal(status="aborted", sequence=()), log=log)
        found = failing("action.result", run, **RESULT)
        assert f"IndexError: list index out of range ({SOURCE}:14)" in found

    def test_never_ends(self):
        run = acting(goal(end_s=None))
        assert "did not come" in failing("action.result", run, **RESULT)

    def test_the_process_died(self):
        run = acting(goal(end_s=None), processes=(died(-11, 1.3),), ending=Ending.EXITED)
        assert "SIGSEGV" in failing("action.result", run, **RESULT)

    def test_late(self):
        run = acting(goal(end_s=2.5))
        assert "did not come for 2.5 s" in failing("action.result", run, **RESULT)
        taken_run = acting(goal(end_s=2.5), disturbance=taken(1.0, 3.5, waited_s=0.6))
        assert judge("action.result", taken_run, **RESULT).disturbed

    def test_goals_that_were_canceled_or_preempted_are_not_judged(self):
        run = acting(goal(), canceled(time_s=2.0), goal(time_s=3.0, preempted=True, end_s=None))
        assert judge("action.result", run, **RESULT).status is Status.PASSED

    def test_no_server_is_told_by_what_there_is(self):
        run = acting(goal(accepted=None, error="no server"), services=())
        assert "has no action of its own" in failing("action.result", run, **RESULT)


class TestFeedback:
    def test_good(self):
        last = {"sequence": [0, 1, 1, 2, 3]}
        finding = judge("action.feedback", acting(goal()), **FEEDBACK, last=last)
        assert finding.status is Status.PASSED
        assert finding.observed == "3 messages at 10 Hz"

    def test_none(self):
        found = failing("action.feedback", acting(goal(feedback=())), **FEEDBACK)
        assert "gave 0 messages of feedback" in found and "publish_feedback" in found

    def test_too_slow(self):
        run = acting(goal(period_s=0.2, end_s=0.9))
        assert "feedback came at 5 Hz" in failing("action.feedback", run, **FEEDBACK)

    def test_slow_because_of_the_machine(self):
        run = acting(goal(period_s=0.2, end_s=0.9), disturbance=taken(1.0, 1.9, waited_s=0.5))
        assert judge("action.feedback", run, **FEEDBACK).disturbed

    def test_another_last_one(self):
        found = failing("action.feedback", acting(goal()), **FEEDBACK, last={"sequence": [1]})
        assert (
            "the last feedback of the goal (order = 4) has sequence = [0, 1, 1, 2, 3] instead of [1]"
            in found
        )

    def test_a_rate_needs_some_feedback(self):
        with pytest.raises(ValueError, match="a rate needs at_least: 3"):
            judge("action.feedback", acting(goal()), **FIB, rate="10 Hz")


class TestRejects:
    def test_rejected(self):
        run = acting(goal(-1, accepted=False), goal(time_s=2.0))
        finding = judge("action.rejects", run, **FIB, goal={"order": -1})
        assert finding.status is Status.PASSED

    def test_accepted(self):
        found = failing("action.rejects", acting(goal(-1)), **FIB, goal={"order": -1})
        assert "the goal (order = -1) was accepted, then succeeded" in found

    def test_never_answered(self):
        run = acting(goal(-1, accepted=None))
        found = failing("action.rejects", run, **FIB)
        assert "was neither accepted nor rejected" in found


class TestCancels:
    def test_in_time(self):
        finding = judge("action.cancels", acting(canceled()), **FIB)
        assert finding.status is Status.PASSED
        assert finding.observed == "canceled 100 ms after it was asked"

    def test_refused(self):
        run = acting(canceled(cancel_accepted=False, status="succeeded"))
        assert "refused to cancel" in failing("action.cancels", run, **FIB)

    def test_agreed_but_succeeded(self):
        run = acting(canceled(status="succeeded", end_s=0.9))
        assert "succeeded instead of being canceled: the execute callback goes on" in failing(
            "action.cancels", run, **FIB
        )

    def test_agreed_but_goes_on(self):
        run = acting(canceled(end_s=None))
        assert "the execute callback goes on" in failing("action.cancels", run, **FIB)

    def test_a_server_that_dies_instead(self):
        # Nobody can say that the machine was too slow: nothing was left that could be late.
        run = acting(
            canceled(end_s=None, cancel_accepted=None, cancel_answered_ns=None),
            processes=(died(-6, 1.25),),
            ending=Ending.EXITED,
            stop_s=1.25,
            disturbance=taken(1.2, 1.25, waited_s=0.02),
        )
        found = failing("action.cancels", run, **FIB)
        assert "did not take in the request to cancel: the process" in found
        assert "ended 1.25 s after launch with SIGABRT (abort)" in found

    def test_the_executor_could_not_take_it_in(self):
        run = acting(
            canceled(cancel_answered_ns=at(2.0), cancel_accepted=False, status="succeeded"),
        )
        assert "its executor cannot while" in failing("action.cancels", run, **FIB)
        lost = acting(canceled(cancel_answered_ns=None, cancel_accepted=None, status="succeeded"))
        assert "its executor cannot while" in failing("action.cancels", lost, **FIB)

    def test_an_executor_that_is_blocked_until_the_end_is_the_student_s_on_any_machine(self):
        blocked = canceled(end_s=None, cancel_accepted=None, cancel_answered_ns=None)
        run = acting(blocked, calls=(), disturbance=taken(2.0, 2.1, waited_s=0.037))
        found = failing("action.cancels", run, **FIB)
        assert "did not take in the request to cancel; its executor cannot while" in found
        assert "spins" not in found
        # What the machine may have taken all of is no finding.
        starved = acting(blocked, calls=(), disturbance=taken(2.0, 2.1, waited_s=3.0))
        assert judge("action.cancels", starved, **FIB).status is Status.ERROR

    def test_a_run_that_ends_before_the_goal_had_its_time(self):
        blocked = canceled(end_s=None, cancel_accepted=None, cancel_answered_ns=None)
        finding = judge("action.cancels", acting(blocked, stop_s=2.0), **FIB)
        assert (finding.status, finding.disturbed) == (Status.ERROR, True)
        assert "before that was due" in finding.observed

    def test_threads_that_only_this_machine_lacks_cost_nothing(self):
        spin = declared("spin", executor="MultiThreadedExecutor", threads=1)
        blocked = canceled(end_s=None, cancel_accepted=None, cancel_answered_ns=None)
        for cpus, status in (("1", Status.ERROR), ("4", Status.FAILED)):
            run = acting(
                blocked, declarations=(declared("started"), spin), environment={"cpus": cpus}
            )
            assert judge("action.cancels", run, **FIB).status is status

    def test_late(self):
        run = acting(canceled(end_s=2.21))
        assert "was not canceled for 2 s" in failing("action.cancels", run, **FIB)
        busy = acting(canceled(end_s=2.21), disturbance=taken(1.2, 3.2, waited_s=1.5))
        assert judge("action.cancels", busy, **FIB).disturbed

    def test_a_goal_that_was_rejected(self):
        run = acting(goal(accepted=False, cancel_after_s=0.2))
        assert "was rejected" in failing("action.cancels", run, **FIB)

    def test_a_goal_that_ended_by_itself_before(self):
        early = canceled(end_s=0.1, status="succeeded", canceled_ns=None, cancel_answered_ns=None)
        found = failing("action.cancels", acting(early), **FIB)
        assert "succeeded 90 ms after it was accepted, before it was to be ended" in found
        log = output(traceback("KeyError: 1"), time_s=1.05)
        aborted = replace(early, status="aborted")
        found = failing("action.cancels", acting(aborted, log=log), **FIB)
        assert "KeyError: 1" in found

    def test_a_probe_that_was_too_late_says_nothing(self):
        late = canceled(end_s=0.9, status="succeeded", canceled_ns=None, cancel_answered_ns=None)
        assert judge("action.cancels", acting(late), **FIB).disturbed

    def test_an_answer_at_the_very_end_tells_of_a_busy_executor(self):
        run = acting(
            canceled(
                status="succeeded", end_s=1.31, cancel_answered_ns=at(2.30), cancel_accepted=False
            )
        )
        assert "its executor cannot while" in failing("action.cancels", run, **FIB)


class TestPreempts:
    def runs(self, **old):
        before = goal(20, 1.0, preempted=True, **{"status": "aborted", "end_s": 0.55, **old})
        return acting(before, goal(5, 1.5, preempts=True))

    def test_in_time(self):
        assert judge("action.preempts", self.runs(), **FIB).status is Status.PASSED

    def test_the_old_goal_succeeds(self):
        run = self.runs(status="succeeded", end_s=2.0)
        assert "was worked on to its end, and succeeded" in failing("action.preempts", run, **FIB)

    def test_the_old_goal_never_ends(self):
        run = self.runs(end_s=None)
        assert "was still worked on at the end" in failing("action.preempts", run, **FIB)

    def test_a_server_that_dies_instead(self):
        run = replace(
            self.runs(end_s=None),
            processes=(died(1, 1.6),),
            ending=Ending.EXITED,
            stop_ns=at(1.6),
            disturbance=taken(1.5, 1.6, waited_s=0.02),
            log=output(traceback("KeyError: 1"), time_s=1.6),
        )
        found = failing("action.preempts", run, **FIB)
        assert "was still worked on at the end: the process" in found
        assert "KeyError: 1" in found

    def test_the_new_goal_is_rejected(self):
        run = acting(goal(20, 1.0, preempted=True), goal(5, 1.5, preempts=True, accepted=False))
        assert "the goal (order = 5) was rejected" in failing("action.preempts", run, **FIB)

    def test_an_old_goal_that_ended_by_itself_before(self):
        found = failing("action.preempts", self.runs(end_s=0.2, status="succeeded"), **FIB)
        assert "the goal (order = 20) succeeded 190 ms after it was accepted" in found

    def test_an_old_goal_that_had_ended_because_the_machine_was_late(self):
        run = replace(self.runs(end_s=0.4), disturbance=taken(1.0, 1.5, waited_s=0.3))
        assert judge("action.preempts", run, **FIB).disturbed

    def test_an_old_goal_that_was_rejected(self):
        run = acting(goal(20, accepted=False), goal(5, 1.5, preempts=True, accepted=False))
        assert "the goal (order = 20) was rejected" in failing("action.preempts", run, **FIB)


def test_declarations_of_the_process_are_not_needed():
    run = acting(goal(), declarations=(declared("started"),))
    assert judge("action.result", run, **RESULT).status is Status.PASSED
