"""Hidden checks are announced and never leak, in no format that a student gets to see."""

from __future__ import annotations

import dataclasses
import io
import json

from hypothesis import assume, given, settings
from hypothesis import strategies as st
from rich.console import Console

from grader.assignment.model import SHOWN_FROM, Withheld
from grader.assignment.selection import visible_part
from grader.checks.check import Subject
from grader.checks.finding import Evidence, Finding, Moment, Plot, Status, Table
from grader.grade import grade
from grader.report.formats import classroom50, github
from grader.report.formats.foxglove import render_layout
from grader.report.formats.gradebook import grades_csv
from grader.report.formats.gradescope import render_gradescope
from grader.report.formats.junit import render_junit
from grader.report.formats.markdown import render_markdown
from grader.report.html.report import render_report
from grader.report.model.class_row import ClassRow
from grader.report.model.result import make_result, result_json
from grader.report.model.student import for_student, grade_for_student
from grader.report.text import explanation
from grader.report.text.terminal import print_grade
from grader.report.text.words import headline, summary
from grader.submission.record import SourceError
from tests.grade.sample import FAIL, Told, make_loaded, make_submission
from tests.report.sample import make_facts, make_run

SECRET = "zq"
"""In every text of a hidden check, and in no other."""
SCENARIOS = ("listen", "zqhard")
IDENTITY = {
    name: "x" for name in ("classroom", "assignment", "submission", "commit", "release", "review")
}


def say(status, mark):
    text = f"{mark}said"
    evidence = Evidence(
        moments=(Moment(f"{text}moment", 0.5),),
        places=(SourceError(f"{text}.py", 3, f"{text}place"),),
        log=(f"{text}log",),
        plots=(Plot(f"{text}plot", f"{text}x", f"{text}y", (0.0, 1.0), (0.0, 2.0)),),
        tables=(Table(f"{text}table", (text,), ((text,),)),),
    )
    if status == "crashed":
        return ValueError(f"{text}crash")
    if status == "passed":
        return Finding.passed(f"{text}expected", f"{text}observed", evidence)
    if status == "failed":
        return Finding.failed(f"{text}expected", f"{text}observed", f"{text}hint", evidence)
    return Finding.error(f"{text}expected", f"{text}observed", hint=f"{text}hint")


@st.composite
def assignments(draw):
    """Checks with all visibilities; no check requires one that is shown later."""
    checks: list[Told] = []
    for number in range(draw(st.integers(1, 6))):
        visibility = draw(st.sampled_from(SHOWN_FROM)) if number else SHOWN_FROM[0]
        hidden = visibility is not SHOWN_FROM[0]
        mark = SECRET if hidden else "open"
        scenarios = draw(st.sampled_from([(), SCENARIOS[1:]])) if hidden else SCENARIOS[:1]
        earlier = [
            check.id
            for check in checks
            if SHOWN_FROM.index(type(visibility)(check.visibility)) <= SHOWN_FROM.index(visibility)
        ]
        checks.append(
            Told(
                f"{mark}{number}",
                say(draw(st.sampled_from(["passed", "failed", "error", "crashed"])), mark),
                title=f"{mark}title{number}",
                hint=f"{mark}own hint",
                points=draw(st.sampled_from([0.5, 1.0, 3.0])),
                requires=tuple(draw(st.sets(st.sampled_from(earlier)))) if earlier else (),
                visibility=visibility.value,
                subject=draw(st.sampled_from(Subject)),
                scenarios=scenarios,
            )
        )
    checks = [
        dataclasses.replace(check, scenarios=()) if check.subject is Subject.SUBMISSION else check
        for check in checks
    ]
    assume(any(check.visibility != "visible" for check in checks))
    return make_loaded(checks, SCENARIOS, {"zqhard": "zqtitle of the scenario"})


def recordings():
    return {name: dataclasses.replace(make_run(), scenario=name) for name in SCENARIOS}


def copy_of_report(loaded):
    """The report that a student is given of a grade with everything in it."""
    whole = grade(loaded, make_submission(), recordings())
    return render_report(grade_for_student(whole), recordings(), make_facts(recordings={}))


def whole_result(loaded):
    runs = recordings()
    facts = make_facts(recordings={name: f"recordings/{name}.mcap" for name in runs})
    return make_result(grade(loaded, make_submission(), runs), runs, facts)


def formats_of(result):
    """Every text that is made for students from a whole result."""
    copy = for_student(result)
    yield result_json(copy)
    yield render_junit(copy)
    yield render_junit(copy, xunit1=True)
    yield render_markdown(copy)
    yield grades_csv([ClassRow(copy.submission.id, result=copy)])
    yield from github.annotation_lines(result)
    yield github.summary(result)
    yield github.outputs(result, "EOF")
    yield classroom50.render_release(result)
    if copy.graded:
        yield classroom50.render_result(result, IDENTITY, "2026-06-01T14:32:01Z")
    gradescope = json.loads(render_gradescope(result))
    hidden_by_gradescope = [t for t in gradescope["tests"] if t["visibility"] != "visible"]
    gradescope["tests"] = [t for t in gradescope["tests"] if t not in hidden_by_gradescope]
    yield json.dumps(gradescope)


def reports_of(loaded):
    """Every text that `check` makes for a student: of the visible part of an assignment."""
    part = visible_part(loaded)
    runs = {scenario.id: recordings()[scenario.id] for scenario in part.assignment.scenarios}
    graded = grade(part, make_submission(), runs)
    facts = make_facts(recordings={name: f"recordings/{name}.mcap" for name in runs})
    stream = io.StringIO()
    print_grade(Console(file=stream, width=120), graded)
    yield stream.getvalue()
    yield render_report(graded, runs, facts)
    yield result_json(make_result(graded, runs, facts))
    yield render_layout(runs.values())


@settings(max_examples=60, deadline=None)
@given(assignments())
def test_no_string_of_a_hidden_check_is_in_anything_for_students(loaded):
    for text in (
        *formats_of(whole_result(loaded)),
        *reports_of(loaded),
        copy_of_report(loaded),
    ):
        assert SECRET not in text


@settings(max_examples=60, deadline=None)
@given(assignments())
def test_the_student_s_copy_is_what_the_visible_part_alone_gives(loaded):
    part = visible_part(loaded)
    runs = {scenario.id: recordings()[scenario.id] for scenario in part.assignment.scenarios}
    alone = make_result(grade(part, make_submission(), runs), runs, make_facts())
    copy = for_student(whole_result(loaded))
    # The same exception is raised again and again here, and its traceback grows.
    checks = tuple(check.model_copy(update={"traceback": ""}) for check in alone.checks)
    alone = alone.model_copy(update={"checks": checks})
    for name in ("score", "max_score", "graded", "first_to_fix", "checks", "withheld"):
        assert getattr(copy, name) == getattr(alone, name)
    assert {one.id for one in copy.scenarios} <= {one.id for one in alone.scenarios}


@settings(max_examples=60, deadline=None)
@given(assignments())
def test_the_student_s_report_is_what_the_visible_part_alone_gives(loaded):
    part = visible_part(loaded)
    runs = {scenario.id: recordings()[scenario.id] for scenario in part.assignment.scenarios}
    alone = grade(part, make_submission(), runs)
    copy = grade_for_student(grade(loaded, make_submission(), recordings()))
    assert (copy.score, copy.max_score, copy.graded) == (alone.score, alone.max_score, alone.graded)
    assert copy.withheld == alone.withheld
    assert [(one.id, one.status, one.waits_for) for one in copy.results] == [
        (one.id, one.status, one.waits_for) for one in alone.results
    ]
    assert not any(item.traceback for one in copy.results for item in one.findings)
    assert {one.id for one in copy.assignment.scenarios} <= set(runs)


def test_a_result_without_hidden_checks_is_its_own_copy():
    whole = grade(make_loaded([Told("a"), Told("b")]), make_submission(), recordings())
    assert grade_for_student(whole) is whole
    result = whole_result(make_loaded([Told("a"), Told("b")]))
    assert for_student(result) is result
    assert result.withheld.checks == 0


def test_hidden_checks_are_announced_with_their_number_and_points():
    checks = [Told(f"c{n}") for n in range(8)]
    checks += [Told(f"h{n}", points=2, visibility="hidden") for n in range(3)]
    part = visible_part(make_loaded(checks))
    assert headline(grade(part, make_submission(), recordings())) == (
        "8 of 8 visible checks passed; 3 hidden checks, 6 points, run at grading."
    )


def test_the_announcement_also_stands_behind_what_failed():
    assert summary(
        [Status.PASSED, Status.FAILED], Withheld(1, 0.5), graded=True, full_points=False
    ) == ("1 check failed; 1 hidden check, 0.5 points, runs at grading.")


def test_what_is_shown_without_points_is_no_reason_to_worry():
    told = grade(
        make_loaded([Told("node"), Told("silence", FAIL, points=0)]),
        make_submission(),
        recordings(),
    )
    assert headline(told) == "Full points; 1 check without points failed."
    assert explanation.headline(make_result(told, recordings(), make_facts())) == headline(told)


def test_an_error_without_points_is_told_beside_full_points():
    checks = [Told("node"), Told("silence", Finding.error("", ""), points=0)]
    told = grade(make_loaded(checks), make_submission(), recordings())
    assert headline(told) == "Full points; 1 check without points could not be judged."
    assert explanation.headline(make_result(told, recordings(), make_facts())) == headline(told)


def test_where_nothing_has_points_none_are_full():
    told = grade(
        make_loaded([Told("node", points=0), Told("silence", FAIL, points=0)]),
        make_submission(),
        recordings(),
    )
    assert headline(told) == "1 check failed."
    assert explanation.headline(make_result(told, recordings(), make_facts())) == headline(told)
