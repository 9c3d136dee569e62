"""action.*: accepted or rejected, with feedback, a result, and an end before that."""

from dataclasses import replace

import pytest

from grader.findings.finding import Status
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
from tests.checks.requests import FIBONACCI, acting, action, canceled, goal, service

FIB = {"action": "/fibonacci"}
WRONG_ONES = {**FIB, "goal": {"order": -1}}
SEQUENCE = {"sequence": [0, 1, 1, 2, 3]}
RESULT = {**FIB, "result": SEQUENCE, "within": "2 s"}
FEEDBACK = {**FIB, "at_least": 3, "rate": "10 Hz"}
UNANSWERED = {"cancel_accepted": None, "cancel_answered_ns": None}
UNASKED = {"canceled_ns": None, "cancel_answered_ns": None}


def preempting(new=None, **old):
    """A goal, and 0.5 s later one that ends it within 50 ms."""
    before = goal(20, 1.0, preempted=True, **{"status": "aborted", "end_s": 0.55, **old})
    return acting(before, goal(5, 1.5, preempts=True, **(new or {})))


@pytest.mark.parametrize(
    ("check", "run", "parameters", "observed"),
    [
        ("exists", acting(), {**FIB, "type": FIBONACCI}, "`/bot_publisher` offers it"),
        ("result", acting(goal()), RESULT, "succeeded: sequence = [0, 1, 1, 2, 3]"),
        # Goals that were canceled or preempted are not judged.
        (
            "result",
            acting(goal(), canceled(time_s=2.0), goal(time_s=3.0, preempted=True, end_s=None)),
            RESULT,
            "succeeded",
        ),
        # Declarations of the process are not needed.
        ("result", acting(goal(), declarations=(declared("started"),)), RESULT, "succeeded"),
        ("feedback", acting(goal()), {**FEEDBACK, "last": SEQUENCE}, "3 messages at 10 Hz"),
        ("feedback", acting(goal()), {**FEEDBACK, "first": {"len(sequence)": 3}}, "3 messages"),
        ("rejects", acting(goal(-1, accepted=False), goal()), WRONG_ONES, "it was rejected"),
        ("cancels", acting(canceled()), FIB, "canceled 100 ms after it was asked"),
        ("preempts", preempting(), FIB, "the old goal ended"),
    ],
)
def test_a_right_action_passes(check, run, parameters, observed):
    finding = judge(f"action.{check}", run, **parameters)
    assert finding.status is Status.PASSED
    assert finding.observed.startswith(observed)


@pytest.mark.parametrize(
    ("check", "run", "parameters", "words"),
    [
        ("exists", acting(services=(action("/fibonaci"),)), FIB, "`/fibonaci` instead of"),
        ("exists", acting(services=(service("/fibonacci"),)), FIB, "created no action"),
        (
            "result",
            acting(goal(sequence=(0, 1, 1, 2))),
            RESULT,
            "sequence = [0, 1, 1, 2] instead of [0, 1, 1, 2, 3]",
        ),
        ("result", acting(goal(sequence=(0, 1, 1, 2))), RESULT, "sets `sequence`"),
        ("result", acting(goal(accepted=False)), RESULT, "the goal (order = 4) was rejected"),
        ("result", acting(goal(status="aborted")), RESULT, "the goal (order = 4) aborted"),
        ("result", acting(goal(status="aborted")), RESULT, "goal_handle.succeed()"),
        ("result", acting(goal(end_s=None)), RESULT, "did not come"),
        ("result", acting(goal(end_s=2.5)), RESULT, "did not come for 2.5 s"),
        (
            "result",
            acting(goal(accepted=None, error="no server"), services=()),
            RESULT,
            "created no action",
        ),
        ("feedback", acting(goal(feedback=())), FEEDBACK, "gave 0 messages of feedback"),
        ("feedback", acting(goal(feedback=())), FEEDBACK, "publish_feedback"),
        ("feedback", acting(goal(period_s=0.2, end_s=0.9)), FEEDBACK, "feedback came at 5 Hz"),
        (
            "feedback",
            acting(goal()),
            {**FEEDBACK, "last": {"sequence": [1]}},
            "has sequence = [0, 1, 1, 2, 3] instead of [1]",
        ),
        ("rejects", acting(goal(-1)), WRONG_ONES, "(order = -1) was accepted, then succeeded"),
        ("rejects", acting(goal(accepted=None)), FIB, "was neither accepted nor rejected"),
        (
            "cancels",
            acting(canceled(cancel_accepted=False, status="succeeded")),
            FIB,
            "refused to cancel",
        ),
        (
            "cancels",
            acting(canceled(status="succeeded", end_s=0.9)),
            FIB,
            "instead of being canceled, although the server agreed to cancel",
        ),
        ("cancels", acting(canceled(end_s=None)), FIB, "the execute callback goes on"),
        ("cancels", acting(canceled(end_s=2.21)), FIB, "was not canceled for 2 s"),
        ("cancels", acting(goal(accepted=False, cancel_after_s=0.2)), FIB, "was rejected"),
        (
            "cancels",
            acting(canceled(end_s=0.1, status="succeeded", **UNASKED)),
            FIB,
            "succeeded 90 ms after it was accepted: too early for this check",
        ),
        ("preempts", preempting(status="succeeded", end_s=2.0), FIB, "worked on to its end"),
        ("preempts", preempting(end_s=None), FIB, "was still worked on at the end"),
        ("preempts", preempting({"accepted": False}), FIB, "the goal (order = 5) was rejected"),
        ("preempts", preempting(accepted=False), FIB, "the goal (order = 20) was rejected"),
        (
            "preempts",
            preempting(end_s=0.2, status="succeeded"),
            FIB,
            "the goal (order = 20) succeeded 190 ms after it was accepted",
        ),
    ],
)
def test_what_is_wrong_is_reported(check, run, parameters, words):
    assert words in failing(f"action.{check}", run, **parameters)


@pytest.mark.parametrize(
    ("check", "run", "parameters"),
    [
        ("result", acting(goal(end_s=2.5), disturbance=taken(1.0, 3.5, waited_s=0.6)), RESULT),
        (
            "feedback",
            acting(goal(period_s=0.2, end_s=0.9), disturbance=taken(1.0, 1.9, waited_s=0.5)),
            FEEDBACK,
        ),
        ("cancels", acting(canceled(end_s=2.21), disturbance=taken(1.2, 3.2, waited_s=1.5)), FIB),
        # The run ended before the goal had its time, and the probe came too late to ask.
        ("cancels", acting(canceled(end_s=None, **UNANSWERED), stop_s=2.0), FIB),
        ("cancels", acting(canceled(end_s=0.9, status="succeeded", **UNASKED)), FIB),
        (
            "preempts",
            replace(preempting(end_s=0.4), disturbance=taken(1.0, 1.5, waited_s=0.3)),
            FIB,
        ),
    ],
)
def test_what_the_machine_or_the_probe_did_is_judged_in_another_run(check, run, parameters):
    finding = judge(f"action.{check}", run, **parameters)
    assert (finding.status, finding.disturbed) == (Status.ERROR, True)


def test_a_goal_that_was_not_aborted_is_not_called_aborted():
    run = acting(goal(status="succeeded"))
    found = failing("action.result", run, **{**RESULT, "status": "aborted"})
    assert "goal_handle.abort()" in found and "rclpy aborts" not in found


def test_a_rate_needs_some_feedback():
    with pytest.raises(ValueError, match="'rate' needs 'at_least': 3"):
        judge("action.feedback", acting(goal()), **FIB, rate="10 Hz")


@pytest.mark.parametrize(
    ("check", "run"),
    [
        ("result", acting(goal(status="aborted", sequence=()))),
        ("cancels", acting(canceled(end_s=0.5, status="aborted"))),
        ("cancels", acting(canceled(end_s=0.1, status="aborted", **UNASKED))),
    ],
)
def test_an_exception_that_rclpy_caught_is_the_cause(check, run):
    log = output(traceback("IndexError: list index out of range"), time_s=1.05)
    parameters = RESULT if check == "result" else FIB
    found = failing(f"action.{check}", replace(run, log=log), **parameters)
    assert f"IndexError: list index out of range ({SOURCE}:14)" in found


@pytest.mark.parametrize(
    ("check", "run", "words"),
    [
        ("result", acting(goal(end_s=None)), "did not come: the process"),
        ("cancels", acting(canceled(end_s=None, **UNANSWERED)), "request to cancel: the process"),
        ("preempts", preempting(end_s=None), "was still worked on at the end: the process"),
    ],
)
def test_a_server_that_ends_is_the_cause_even_on_a_busy_machine(check, run, words):
    run = replace(
        run, processes=(died(-6, 1.6),), ending=Ending.EXITED, stop_ns=at(1.6),
        disturbance=taken(1.5, 1.6, waited_s=0.02),
    )  # fmt: skip
    found = failing(f"action.{check}", run, **(RESULT if check == "result" else FIB))
    assert words in found
    assert "SIGABRT (abort)" in found


def test_an_action_that_is_gone_before_it_took_a_goal_is_not_offered():
    gone = (replace(action(), vanished_ns=at(0.9)),)
    found = failing("action.exists", acting(services=gone), **FIB)
    assert "the action `/fibonacci` was destroyed 0.90 s after launch" in found
    used = acting(goal(time_s=0.5), services=gone)
    assert judge("action.exists", used, **FIB).status is Status.PASSED
