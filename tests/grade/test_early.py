"""Verdicts while other scenarios still run: only those that nothing can change any more."""

from __future__ import annotations

from dataclasses import replace

from grader.checks.check import Subject
from grader.findings.finding import Status
from grader.grade.early import judge_early
from grader.grade.judging import judge_all
from grader.spec.names import Names, Thing, WrongName
from tests.grade.sample import FAIL, PASS, Told, make_loaded, make_recording, make_submission

SCENARIOS = ("near", "far")
NEAR = {"near": make_recording("near")}


def early(*checks, recordings=NEAR, wanted=None):
    loaded = make_loaded(checks, SCENARIOS)
    names = wanted or [check.id for check in checks]
    found = judge_early(loaded, make_submission(), recordings, names)
    return {one.id: one.status for one in found}


def test_a_check_is_told_when_its_last_scenario_is_recorded():
    stops = Told("stops", FAIL, scenarios=("near",))
    turns = Told("turns", PASS, scenarios=("near", "far"))
    assert early(stops, turns) == {"stops": Status.FAILED}
    both = {name: make_recording(name) for name in SCENARIOS}
    whole = judge_all(make_loaded((stops, turns), SCENARIOS), make_submission(), both)
    assert early(stops, turns, recordings=both) == {one.id: one.status for one in whole.results}


def test_what_it_requires_is_judged_in_the_runs_so_far():
    stops = Told("stops", PASS, requires=("alive",), scenarios=("near",))
    alive = Told("alive", {"near": PASS})
    assert early(alive, stops, wanted=["stops"]) == {"stops": Status.PASSED}
    assert early(Told("alive", {"near": FAIL}), stops, wanted=["stops"]) == {}
    built = Told("built", FAIL, Subject.SUBMISSION)
    assert early(built, recordings={}) == {"built": Status.FAILED}


def test_what_may_be_run_again_is_not_told():
    disturbed = Told("period", FAIL.doubted(), scenarios=("near",))
    misnamed = Told(
        "topic",
        replace(FAIL, names=Names.of([WrongName(Thing.TOPIC, "/cmdvel", "/cmd_vel")])),
        scenarios=("near",),
    )
    broken = Told("broken", ZeroDivisionError(), scenarios=("near",))
    assert early(disturbed, misnamed, broken) == {}
