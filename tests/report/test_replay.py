"""What a replay is made of, and that it is small and inert."""

import json
import math
from dataclasses import replace
from itertools import accumulate

import pytest

from grader.assignment.model import RandomRange
from grader.report.html.replay import DIGITS, NO_RETURN_CM, embedded, make_replay, with_goals
from tests.grade.sample import Told, make_loaded
from tests.report.gallery import ahead_until, gallery, reference
from tests.report.sample import make_run


@pytest.fixture(scope="module")
def run():
    return ahead_until(0.2)


@pytest.fixture(scope="module")
def replay(run):
    return make_replay(run, gallery().grade.assignment.scenarios[1])


def test_positions_are_those_of_the_truth_to_the_millimetre(run, replay):
    x = [value / 1e3 for value in accumulate(replay["x"])]
    assert x == pytest.approx([step.x_m for step in run.truth[::10]], abs=6e-4)
    assert replay["step"] == 0.1
    assert replay["began"] == pytest.approx(run.since_launch_s(run.truth[0].time_ns), abs=1e-3)


def test_beams_are_those_of_the_scans_to_the_centimetre(run, replay):
    scans = replay["scans"]
    first = run.on("/scan")[0].value
    every = len(first["ranges"]) // scans["beams"]
    for beam, true in enumerate(first["ranges"][::every]):
        high, low = scans["ranges"][2 * beam : 2 * beam + 2]
        number = 64 * DIGITS.index(high) + DIGITS.index(low)
        assert number == NO_RETURN_CM if math.isinf(true) else abs(number / 100 - true) <= 0.0051
    assert len(scans["ranges"]) == 2 * scans["beams"] * len(scans["times"])


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e38])
def test_a_scan_that_a_submission_forged_stops_no_report(run, value):
    forged, *others = run.on("/scan")
    odd = {"angle_min": value, "angle_increment": value, "ranges": [value] * 3}
    forged = replace(forged, value={**forged.value, **odd})
    faked = replace(run, messages={**run.messages, "/scan": (forged, *others)})
    assert embedded(make_replay(faked, gallery().grade.assignment.scenarios[1]))


def test_a_scenario_without_a_robot_has_none():
    assert make_replay(make_run(), gallery().grade.assignment.scenarios[0]) is None


def test_goals_are_where_the_checks_want_the_robot_with_the_run_s_own_values(replay):
    random = {"goal_x": RandomRange.model_validate([0.1, 0.5])}
    scenario = gallery().grade.assignment.scenarios[1].model_copy(update={"random": random})
    made = make_replay(replace(ahead_until(0.2), values={"goal_x": 0.31}), scenario)
    spec = {"goal": ["goal_x", "-0.2", "90 deg"], "position": "8 cm"}
    loaded = make_loaded([Told("reaches", scenarios=("drive",))], ("listen", "drive"))
    check = loaded.assignment.checks[0].model_copy(update={"with_": spec})
    assignment = loaded.assignment.model_copy(update={"checks": (check,)})
    assert with_goals(made, assignment, "drive")["goals"] == [[310, -200, 1571, 80, "8 cm"]]
    assert with_goals(made, assignment, "listen")["goals"] == []
    other = check.model_copy(update={"id": "near", "with_": {**spec, "position": "3 cm"}})
    plain = check.model_copy(update={"id": "law", "with_": {"goal": spec["goal"]}})
    several = loaded.assignment.model_copy(update={"checks": (plain, check, other)})
    assert with_goals(made, several, "drive")["goals"] == [[310, -200, 1571, 80, "8 cm"]]
    # A run that was kept by an earlier version does not say its values.
    assert with_goals(replay | {"given": {}}, assignment, "drive")["goals"] == []


def test_text_in_the_data_cannot_end_its_element():
    text = embedded({"log": "</script><!--<script>&"})
    assert not set("<>&") & set(text)
    assert json.loads(text) == {"log": "</script><!--<script>&"}


def test_a_report_of_eight_robot_runs_stays_below_a_megabyte(replay):
    # Eight runs of ten seconds with their references, as bot_controller has them.
    assert 8 * 2 * len(embedded(replay)) < 600_000


def test_a_report_with_every_kind_of_picture_is_small():
    assert len(gallery().html(reference()).encode()) < 300_000
