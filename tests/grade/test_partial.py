"""Looser parameters that give a share of the points."""

import pytest

from grader.assignment.load import load_assignment
from grader.errors import AssignmentError
from grader.grade import judge_all
from tests.assignment.lessons import HEAD
from tests.checks.builder import every, messages, recording

CHECK = """\
  - id: period
    uses: timing.period
    with: {{topic: /cmd_vel, period: 310 ms, tolerance: {tolerance}}}
    partial:
      - {{share: 25 %, with: {{tolerance: 20 %}}}}
      - {{share: 75 %, with: {{tolerance: 5 %}}}}
    points: 4
"""


def points(folder, tolerance, looser="5 %", window="", **changes):
    (folder / "lesson").mkdir()
    text = HEAD + CHECK.format(tolerance=tolerance).replace("5 %}}", f"{looser}}}}}") + window
    (folder / "lesson" / "assignment.yaml").write_text(text)
    run = recording(scenario="run", **changes)
    result = judge_all(load_assignment(folder / "lesson"), run.submission, {"run": run})
    return result.results[0]


def test_the_right_parameters_give_all_points(tmp_path):
    assert points(tmp_path, "4 %").points == 4.0


def test_of_looser_parameters_that_fit_the_best_share_counts(tmp_path):
    found = points(tmp_path, "1 %")
    assert found.points == 3.0
    assert found.decisive.finding.observed.endswith("this gives 75 % of the points")


def test_parameters_that_do_not_fit_either_give_nothing_more(tmp_path):
    assert points(tmp_path, "1 %", looser="2 %").points == 1.0


def test_looser_parameters_are_judged_in_the_window_of_the_check(tmp_path):
    published = messages(every(0.01, 40, 0.7) + every(0.3, 9, 2.0))
    found = points(tmp_path, "1 %", window="    from: 1500 ms\n", messages=published)
    assert found.points == 3.0


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("tolerance: 5 %", "tolerence: 5 %", "partial[1].with"),
        ("share: 75 %", "share: 100 %", "the share is below 100 %"),
    ],
)
def test_a_mistake_in_looser_parameters_is_found_before_any_run(tmp_path, before, after, words):
    (tmp_path / "lesson").mkdir()
    text = HEAD + CHECK.format(tolerance="1 %").replace(before, after)
    (tmp_path / "lesson" / "assignment.yaml").write_text(text)
    with pytest.raises(AssignmentError) as raised:
        load_assignment(tmp_path / "lesson")
    assert words in str(raised.value)
