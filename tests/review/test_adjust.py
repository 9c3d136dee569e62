"""Results with what persons add to them."""

import json

import pytest

from grader.errors import UsageError
from grader.findings.finding import Finding
from grader.report.audience import for_student
from grader.report.model.class_row import ClassRow, RowStatus
from grader.report.model.cluster import cause
from grader.report.model.result import result_json
from grader.report.model.result_model import AdjustmentPart, Result
from grader.review.adjust import adjusted
from grader.review.model import ClassReview, Comment, Forgiven, Given, ManualScore, StudentReview
from tests.grade.sample import Told
from tests.report.sample import judged

FAILED = Finding.failed("a period of 300 ms", "322 ms", credit=0.5)
README = AdjustmentPart(kind="manual", title="README", points=None, max_points=2.0, item="readme")
NOTHING = ClassReview()
SCORED = StudentReview(
    key="ana",
    manual={"readme": ManualScore(points=1.5, by="AB"), "gone": ManualScore(points=9, by="AB")},
    comments=(Comment(text="Nice", by="AB"),),
)


@pytest.fixture
def result() -> Result:
    checks = [
        Told("node"),
        Told("period", FAILED, points=3.0),
        Told("secret", FAILED, points=4.0, visibility="hidden"),
        Told("steady", requires=("period",), points=2.0),
    ]
    return judged(checks).result.model_copy(update={"adjustments": (README,)})


def forgiving(result: Result, check: str, share: float = 1.0) -> ClassReview:
    why = cause(next(one for one in result.checks if one.id == check))
    forgiven = Forgiven(check=check, cause=why, share=share, reason="our typo", by="CD")
    return ClassReview(forgiven=(forgiven,))


def test_a_manual_item_counts_once_it_is_scored_and_until_then_there_is_no_final_score(
    result: Result,
) -> None:
    waiting = adjusted(result, StudentReview(key="ana"), NOTHING)
    assert (waiting.final_score, waiting.final_max_score) == (None, 12.0)
    assert ClassRow("ana", result=waiting).status is RowStatus.WAITING
    scored = adjusted(waiting, SCORED, NOTHING)
    # 1 for the node, half of 3 and half of 4; nothing for what is not an item any more.
    assert (scored.score, scored.final_score) == (4.5, 6.0)
    assert ClassRow("ana", result=scored).score == 6.0
    assert [comment.text for comment in scored.comments] == ["Nice"]
    assert adjusted(scored, StudentReview(key="ana"), NOTHING) == waiting


def test_doing_it_again_changes_nothing_and_no_check_ends_differently(result: Result) -> None:
    of_class = forgiving(result, "period")
    once = adjusted(result, SCORED, of_class)
    assert adjusted(once, SCORED, of_class) == once
    assert Result.model_validate(json.loads(result_json(once))) == once
    assert (once.score, once.checks) == (result.score, result.checks)


@pytest.mark.parametrize(("share", "points"), [(1.0, 1.5), (0.5, 0.75)])
def test_forgiving_gives_back_what_the_check_lost_and_nothing_for_what_was_not_judged(
    result: Result, share: float, points: float
) -> None:
    found = adjusted(result, SCORED, forgiving(result, "period", share))
    (line,) = [one for one in found.adjustments if one.kind == "forgiven"]
    assert (line.check, line.points, line.by, line.reason) == ("period", points, "CD", "our typo")
    assert found.final_score == 6.0 + points


def test_another_cause_of_the_same_check_is_not_forgiven(result: Result) -> None:
    other = ClassReview(forgiven=(Forgiven(check="period", cause="no message", by="CD"),))
    assert adjusted(result, SCORED, other).final_score == 6.0


def test_a_student_learns_nothing_of_a_hidden_check_by_its_being_forgiven(result: Result) -> None:
    found = adjusted(result, SCORED, forgiving(result, "secret"))
    assert found.final_score == 8.0
    assert "secret" not in result_json(for_student(found))


def test_no_score_falls_below_zero(result: Result) -> None:
    late = AdjustmentPart(kind="late", title="2 days late", points=-99.0)
    found = result.model_copy(update={"adjustments": (late,)})
    assert found.final_score == 0.0


def test_more_points_than_an_item_has_are_refused(result: Result) -> None:
    review = StudentReview(key="ana", manual={"readme": ManualScore(points=20, by="AB")})
    with pytest.raises(UsageError, match=r"ana: manual\.readme: has 20 points, but at most 2 "):
        adjusted(result, review, NOTHING)


@pytest.mark.parametrize(("points", "instead"), [(-0.5, False), (2.0, False), (2.0, True)])
def test_a_check_that_could_not_be_judged_is_settled_only_by_points_in_place_of_it(
    points: float, instead: bool
) -> None:
    lost = judged([Told("node"), Told("x", Finding.error("a node", "a full disk"))]).result
    given = Given(points=points, reason="seen", by="AB", check="x", instead=instead)
    found = adjusted(lost, StudentReview(key="ana", given=(given,)), NOTHING)
    assert found.graded is instead
    assert found.final_score == (3.0 if instead else None)
    assert found.settled == ({"x"} if instead else set())
