"""What clients ask of servers of the scenario."""

from __future__ import annotations

from typing import Any

import pytest

from grader.findings.finding import Status
from grader.recording.model import Recording
from tests.checks.builder import at, call, failing, judge, taken
from tests.checks.requests import acting, asking, canceled, goal, to_action, to_service

SERVICE: dict[str, Any] = {"server": "/enable"}
ACTION: dict[str, Any] = {"server": "/fibonacci"}
ON, OFF = {"data": True}, {"data": False}
TWO = {**SERVICE, "sequence": [ON, OFF]}
IN_TURN = {**TWO, "after_result": True}
CHECK = "client.asks"


def pair(second_s: float, took_s: float | None = 0.5, **changes: Any) -> Recording:
    """A request that is answered after 0.5 s, and a second one."""
    return asking(to_service(1.0, took_s, **changes), to_service(second_s, fields=OFF))


@pytest.mark.parametrize(
    "parameters",
    [TWO, IN_TURN, {**SERVICE, "more": True}, {**SERVICE, "sequence": [{}, {}]}],
)
def test_right_requests_in_order_pass(parameters: dict[str, Any]) -> None:
    assert judge(CHECK, pair(1.6), **parameters).status is Status.PASSED


def test_another_value_another_order_and_one_too_many_fail() -> None:
    wrong = failing(CHECK, pair(1.6), **SERVICE, sequence=[OFF, ON])
    assert "data = true instead of false" in wrong
    assert "asked 2 times, not 1" in failing(CHECK, pair(1.6), **SERVICE)


def test_a_request_before_the_response_to_the_one_before_fails_only_where_it_must_wait() -> None:
    assert judge(CHECK, pair(1.2), **TWO).status is Status.PASSED
    seen = failing(CHECK, pair(1.2), **IN_TURN)
    assert "(data = false) came before the result of data = true" in seen


def test_a_client_that_gives_up_on_an_answer_that_never_comes_is_right() -> None:
    run = pair(3.0, None, status="unanswered")
    assert judge(CHECK, run, **IN_TURN).status is Status.PASSED
    assert "came before the result" in failing(CHECK, pair(3.0, None), **IN_TURN)


def test_a_goal_must_wait_for_the_end_of_the_goal_before_and_not_for_its_acceptance() -> None:
    two = {**ACTION, "sequence": [{"order": 4}, {"order": 5}], "after_result": True}
    right = asking(to_action(4, 1.0), to_action(5, 1.6))
    assert judge(CHECK, right, **two).status is Status.PASSED
    early = asking(to_action(4, 1.0), to_action(5, 1.2))
    assert "get_result_async()" in failing(CHECK, early, **two)
    rejected = asking(to_action(4, 1.0, "rejected", ended_ns=at(1.0)), to_action(5, 1.2))
    assert judge(CHECK, rejected, **two).status is Status.PASSED


@pytest.mark.parametrize(
    ("status", "hint"),
    [
        ("rejected", "Look at goal_handle.accepted"),
        ("aborted", "Look at the status"),
        ("unanswered", "timeout_sec"),
        ("succeeded", "Send the next one in the callback"),
    ],
)
def test_a_client_that_stops_is_told_what_it_stopped_after(status: str, hint: str) -> None:
    run = asking(to_action(status=status))
    assert hint in failing(CHECK, run, **ACTION, sequence=[{}, {}])


def test_a_client_that_never_asks_is_told_to_wait_for_the_server() -> None:
    seen = failing(CHECK, asking(), **SERVICE)
    assert "although the client was there" in seen and "wait_for_service" in seen
    assert "self.create_client(Type, 'enable')" in failing(CHECK, asking(clients=()), **SERVICE)
    assert "ActionClient(self, Type, 'fibonacci')" in failing(CHECK, asking(clients=()), **ACTION)


def test_a_callback_that_waits_for_the_response_is_told_of_the_deadlock() -> None:
    hangs = tuple(call(0.5 * n, None) for n in range(2, 6))
    seen = failing(CHECK, asking(to_service(0.7), calls=hangs), **TWO)
    assert "blocks the executor" in seen and "use call_async()" in seen


def test_a_request_that_the_machine_may_have_kept_from_coming_costs_nothing() -> None:
    busy = asking(to_service(), disturbance=taken(0.1, 4.4, waited_s=4.2))
    assert judge(CHECK, busy, **TWO).status is Status.ERROR


def test_a_goal_is_canceled_at_its_time() -> None:
    def run(canceled_s: float | None) -> Recording:
        canceled_ns = None if canceled_s is None else at(1.0 + canceled_s)
        return asking(to_action(status="canceled", canceled_ns=canceled_ns))

    span = {**ACTION, "cancels": ["500 ms", "800 ms"]}
    assert judge(CHECK, run(0.6), **span).status is Status.PASSED
    assert "asked to cancel 300 ms after" in failing(CHECK, run(0.3), **span)
    assert "asked to cancel 1 s after" in failing(CHECK, run(1.0), **span)
    assert "cancel_goal_async()" in failing(CHECK, run(None), **span)


def test_a_goal_that_had_no_time_to_be_canceled_costs_nothing() -> None:
    short = asking(to_action(4, 4.0, "accepted"))
    assert judge(CHECK, short, **ACTION, cancels=["1 s", "2 s"]).status is Status.ERROR


def test_the_result_of_a_canceled_goal_is_judged_where_that_is_asked_for() -> None:
    run = acting(goal(), canceled(sequence=(0, 1)))
    wanted = {"action": "/fibonacci", "status": "canceled", "within": "2 s"}
    right = judge("action.result", run, **wanted, result={"sequence": [0, 1]})
    assert right.status is Status.PASSED
    assert "sequence" in failing("action.result", run, **wanted, result={"sequence": [0]})
    ended = acting(canceled(status="aborted"))
    assert "goal_handle.canceled()" in failing("action.result", ended, **wanted)
