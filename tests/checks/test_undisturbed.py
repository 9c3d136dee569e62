"""One delay of the machine leaves open only what it can explain: the rest of the run decides."""

from __future__ import annotations

import pytest

from grader.findings.finding import Status
from tests.checks.builder import every, failing, judge, message, taken
from tests.checks.requests import acting, asked, goal, serving
from tests.checks.test_action import FEEDBACK, RESULT
from tests.checks.test_concurrency import BOTH, HEARD, TICK, ran
from tests.checks.test_concurrency import run as running
from tests.checks.test_following import TIMES, failure, place, right, run, status, verdict
from tests.checks.test_latency import QUESTIONS_S, answered, latency
from tests.checks.test_service import SLOW


def test_a_pool_of_one_worker_is_known_by_the_calls_that_nothing_delayed():
    calls = [
        asked(at_s + more_s, 0.4 + more_s * 400) for at_s in (1.0, 2.0) for more_s in (0, 1e-3)
    ]
    run = serving(*calls, disturbance=taken(1.0, 1.9, waited_s=0.4))
    assert "the second call waited" in failing("service.concurrent", run, **SLOW)
    alone = serving(*calls[:2], disturbance=taken(1.0, 1.9, waited_s=0.4))
    assert judge("service.concurrent", alone, **SLOW).disturbed


@pytest.mark.parametrize("calls", ["side_by_side", "one_after_another"])
def test_a_trifle_does_not_excuse_how_calls_were_processed(calls):
    between = [asked(1.0, 0.4), asked(1.001, 0.65)]
    trifle = serving(*between, disturbance=taken(1.0, 1.9, waited_s=0.002))
    assert "neither together nor" in failing("service.concurrent", trifle, **SLOW, calls=calls)
    much = serving(*between, disturbance=taken(1.0, 1.9, waited_s=0.2))
    assert judge("service.concurrent", much, **SLOW, calls=calls).disturbed


def test_callbacks_that_wait_for_each_other_are_not_excused_by_one_stall():
    begins = every(0.5, 5)
    runs = [
        ran(at + late, at + late + 0.2, of)
        for at in begins
        for of, late in ((TICK, 0), (HEARD, 0.2))
    ]
    one_stall = taken(begins[0], begins[0] + 0.2, waited_s=0.15)
    failing("executor.overlap", running(*runs, disturbance=one_stall), **BOTH)


def test_a_goal_that_nothing_delayed_decides_for_all():
    stall = taken(1.0, 3.5, waited_s=0.6)
    wrong = acting(goal(end_s=2.5), goal(5, 4.0, sequence=(9,)), disturbance=stall)
    assert "sequence = [9]" in failing("action.result", wrong, **RESULT)
    wrong = acting(
        goal(period_s=0.2, end_s=0.9),
        goal(5, 4.0, feedback=()),
        disturbance=taken(1.0, 1.9, waited_s=0.5),
    )
    assert "gave 0 messages" in failing("action.feedback", wrong, **FEEDBACK)


class TestFollows:
    STALL = taken(2.0, 2.079, waited_s=0.079)

    def test_old_values_in_a_stall_do_not_leave_all_the_others_open(self):
        def held_up(time_s):
            return right(time_s - 0.55 if 2.0 <= time_s <= 2.079 else time_s)

        good = run(held_up, disturbance=self.STALL)
        assert verdict(good).status is Status.PASSED
        # Where every message is disturbed, none of them decides.
        always = run(lambda t: right(t - 0.55), times=TIMES[20:])
        waits = (one for at in TIMES for one in taken(at, at + 0.04, waited_s=0.02))
        busy = run(lambda t: right(t - 0.55), times=TIMES[20:], disturbance=tuple(waits))
        assert verdict(always).status is Status.FAILED
        assert verdict(busy).disturbed

    def test_a_wrong_filter_is_wrong_outside_of_the_stall(self):
        half = run(lambda t: status(*(0.5 * one for one in place(t))), disturbance=self.STALL)
        assert "instead of" in failure(half)


def test_an_answer_that_never_comes_is_not_excused_by_a_trifle():
    times = [q + 0.01 for n, q in enumerate(QUESTIONS_S) if n != 4]
    trifle = taken(QUESTIONS_S[4], QUESTIONS_S[4] + 0.1, waited_s=0.005)
    lost = answered([], messages={"/cmd_vel": tuple(map(message, times))}, disturbance=trifle)
    allowed = latency(median="20 ms", within="200 ms")
    assert "had no answer" in failing("timing.latency", lost, **allowed)
    long = taken(QUESTIONS_S[4], QUESTIONS_S[4] + 0.1, waited_s=0.4)
    # While the node waited, the next message may have taken its place in the queue.
    lost = answered([], messages={"/cmd_vel": tuple(map(message, times))}, disturbance=long)
    assert judge("timing.latency", lost, **allowed).disturbed
