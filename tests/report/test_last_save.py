"""What a student reads of the last save in one line."""

from __future__ import annotations

from dataclasses import replace

from grader.findings.finding import Finding
from grader.report.text.last_save import bars, early_line, failed_scenarios, what_changed
from tests.grade.sample import FAIL, PASS, Told
from tests.report.sample import judged


def result(**says):
    return judged([Told(name, one, points=1.5) for name, one in says.items()]).result


def test_points_won_and_lost_are_named_with_their_checks():
    before, after = result(period=FAIL, timer=PASS), result(period=PASS, timer=FAIL)
    assert what_changed(before, after) == (
        "“Title of timer”: passed → failed, −1.5; “Title of period”: failed → passed, +1.5"
    )
    assert what_changed(after, after) == "no check changed"


def test_partial_credit_alone_is_a_change():
    before = result(period=replace(FAIL, credit=0.2))
    assert (
        what_changed(before, result(period=replace(FAIL, credit=0.4)))
        == "“Title of period”: failed, +0.3"
    )


def test_what_could_not_be_judged_wins_and_loses_nothing():
    fault = result(period=Finding.error("a run", "the machine"))
    assert what_changed(fault, result(period=PASS)) == "“Title of period”: error → passed"


def test_of_many_changes_the_largest_are_named():
    names = "abcdef"
    before = result(**dict.fromkeys(names, FAIL))
    told = what_changed(before, result(**dict.fromkeys(names, PASS), g=PASS))
    assert told.count("failed → passed, +1.5") == 4
    assert told.endswith("; 2 more; 1 new")


def test_every_score_of_the_evening_has_a_bar():
    assert bars([0, 5, None, 10], 10) == "▁▅·█"
    assert bars([0.0], 0) == "▁"


def test_what_failed_before_is_told_with_its_reason():
    grade = judged([Told("period", FAIL), Told("timer", PASS)])
    lines = [early_line(one) for one in grade.grade.results]
    assert lines == ["“Title of period” still fails: no node at all", "“Title of timer” passes now"]
    assert failed_scenarios(grade.result) == {"listen"}
    assert failed_scenarios(result(timer=PASS)) == frozenset()
