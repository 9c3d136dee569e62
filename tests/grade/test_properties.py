"""What holds for every grade, for any findings."""

from hypothesis import given
from hypothesis import strategies as st

from grader.findings.finding import Finding, Status
from grader.grade import judge_all
from tests.grade.sample import FAIL, PASS, Told, make_loaded, make_recording, make_submission

SCENARIOS = ("listen", "renamed")
ERROR = Finding.error("a period of 300 ms", "the host took 0.3 s", disturbed=True)
SAYINGS = st.one_of(
    st.sampled_from([PASS, PASS, PASS, FAIL, ERROR, ValueError("bug")]),
    st.floats(0, 1, exclude_max=True).map(lambda credit: Finding.failed("", "", credit=credit)),
)


@st.composite
def assignments(draw):
    checks = []
    for index in range(draw(st.integers(1, 7))):
        earlier = [told.id for told in checks]
        requires = draw(st.lists(st.sampled_from(earlier), unique=True)) if earlier else []
        checks.append(
            Told(
                f"c{index}",
                {name: draw(SAYINGS) for name in SCENARIOS},
                requires=tuple(requires),
                points=float(draw(st.decimals(0, 10, places=2))),
            )
        )
    return draw(st.permutations(checks))


def judge(checks, scenarios=SCENARIOS):
    recordings = {name: make_recording(name) for name in scenarios}
    return judge_all(make_loaded(checks, SCENARIOS), make_submission(), recordings)


@given(assignments())
def test_a_score_lies_between_zero_and_its_maximum(checks):
    result = judge(checks)
    assert 0.0 <= result.score <= result.max_score
    assert all(0.0 <= item.points <= item.max_points for item in result.results)


@given(assignments())
def test_full_points_mean_that_every_check_with_points_passed(checks):
    result = judge(checks)
    passed = all(item.status is Status.PASSED for item in result.results if item.max_points)
    assert result.full_points == (passed and result.graded)


@given(assignments())
def test_a_check_is_skipped_exactly_where_a_requirement_did_not_pass(checks):
    result = judge(checks)
    for told in checks:
        lacking = any(result.result(name).status is not Status.PASSED for name in told.requires)
        assert (result.result(told.id).status is Status.SKIPPED) == lacking


@given(assignments())
def test_every_skip_leads_to_a_check_that_was_judged(checks):
    result = judge(checks)
    for item in result.results:
        roots = {result.result(root).status for root in item.waits_for}
        assert bool(roots) == (item.status is Status.SKIPPED)
        assert roots <= {Status.FAILED, Status.ERROR}


@given(assignments(), st.randoms(use_true_random=False))
def test_the_order_in_which_checks_are_written_changes_no_verdict(checks, random):
    shuffled = list(checks)
    random.shuffle(shuffled)
    one, other = judge(checks), judge(shuffled)
    assert {item.id: (item.status, item.points) for item in one.results} == {
        item.id: (item.status, item.points) for item in other.results
    }
    assert one.score == other.score
