"""The attempts of a student."""

from grader.findings.finding import Finding
from grader.grading.attempts import MOST_KEPT, attempts_of, with_history
from grader.grading.files import RESULT_FILE
from grader.report.audience import for_student
from grader.report.files import write_whole
from grader.report.model.result import read_result, result_json
from tests.grade.sample import Told
from tests.report.sample import judged


def result_of(sha256, period_s, started="2026-03-14T12:00:00+01:00"):
    """A submission whose period is right at 0.3 s; a hidden check fails with it."""
    right = Finding.passed("0.3 s", f"{period_s} s")
    found = right if period_s == 0.3 else Finding.failed("0.3 s", f"{period_s} s")
    checks = [
        Told("node"),
        Told("period", found, points=3, title="The period of `/chatter`"),
        Told("secret", found, points=2, title="The secret", visibility="hidden"),
    ]
    result = judged(checks).result
    submission = result.submission.model_copy(update={"sha256": sha256})
    return result.model_copy(update={"submission": submission, "started": started})


def graded(folder, result):
    """Grade into the folder of a report, as `rosgrade check` does."""
    result = with_history(folder, result)
    write_whole(folder / RESULT_FILE, result_json(result))
    return result


def test_each_attempt_says_what_changed_since_the_one_before():
    lost, full = result_of("a", 0.5), result_of("b", 0.3)
    first, second = attempts_of([lost, full], ["", "2026-03-15T09:00:00Z"])
    assert (first.score, first.changes, first.counts) == (lost.score, (), False)
    assert (second.score, second.handed_in, second.counts) == (
        full.score,
        "2026-03-15T09:00:00Z",
        True,
    )
    assert second.changes == (
        "The period of `/chatter`: failed → passed, +3",
        "The secret: failed → passed, +2",
    )


def test_a_report_shows_earlier_grades_of_its_folder(tmp_path):
    assert graded(tmp_path, result_of("a", 0.5)).attempts == ()
    result = graded(tmp_path, result_of("b", 0.3))
    assert [one.sha256 for one in result.attempts] == ["a", "b"]
    assert read_result(tmp_path / RESULT_FILE).attempts == result.attempts


def test_the_same_sources_again_are_no_other_attempt(tmp_path):
    lost, full = result_of("a", 0.5), result_of("b", 0.3)
    for result in (lost, lost, full, full):
        last = graded(tmp_path, result)
    assert [one.sha256 for one in last.attempts] == ["a", "b"]


def test_a_run_of_some_checks_is_no_attempt_at_all_of_them(tmp_path):
    lost = result_of("a", 0.5)
    other = result_of("b", 0.5)
    some = other.model_copy(update={"checks": other.checks[:1]})
    for result in (lost, some, result_of("c", 0.3)):
        last = graded(tmp_path, result)
    assert [one.sha256 for one in last.attempts] == ["a", "c"]


def test_only_the_newest_attempts_are_kept(tmp_path):
    for number in range(MOST_KEPT + 3):
        last = graded(tmp_path, result_of(str(number), 0.5))
    assert len(last.attempts) == MOST_KEPT + 1
    assert last.attempts[-1].sha256 == str(MOST_KEPT + 2)


def test_a_damaged_earlier_result_is_left_out(tmp_path):
    graded(tmp_path, result_of("a", 0.5))
    graded(tmp_path, result_of("b", 0.3))
    (kept,) = (tmp_path / "earlier").iterdir()
    kept.write_text("{")
    assert len(graded(tmp_path, result_of("c", 0.3)).attempts) == 2


def test_a_students_copy_says_nothing_of_hidden_checks_in_earlier_attempts():
    results = [result_of("a", 0.5), result_of("b", 0.3)]
    whole = results[1].model_copy(update={"attempts": attempts_of(results)})
    assert [one.score for one in whole.attempts] == [1.0, 6.0]
    copy = for_student(whole)
    assert [(one.score, one.max_score) for one in copy.attempts] == [(1.0, 4.0), (4.0, 4.0)]
    assert len(copy.attempts[1].changes) == 1
    assert "secret" not in result_json(copy)


def test_a_new_grade_does_not_lose_which_hints_were_opened(tmp_path):
    counted = result_of("a", 0.5).model_copy(update={"hints_opened": {"period": 2}})
    graded(tmp_path, counted)
    assert graded(tmp_path, result_of("b", 0.3)).hints_opened == {"period": 2}
    assert graded(tmp_path, judged([Told("node")]).result).hints_opened == {"period": 2}
    assert read_result(tmp_path / RESULT_FILE).hints_opened == {"period": 2}


def test_another_assignment_in_the_same_folder_takes_no_counts_over(tmp_path):
    graded(tmp_path, result_of("a", 0.5).model_copy(update={"hints_opened": {"period": 2}}))
    other = result_of("a", 0.5)
    assignment = other.assignment.model_copy(update={"id": "another"})
    other = other.model_copy(update={"assignment": assignment})
    assert graded(tmp_path, other).hints_opened is None
