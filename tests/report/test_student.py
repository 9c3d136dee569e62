"""Hidden checks are announced and never leak, in no format that a student gets to see."""

from __future__ import annotations

import dataclasses
import json
from contextlib import suppress
from importlib import import_module
from pkgutil import iter_modules

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from grader.assignment.model import SHOWN_FROM
from grader.assignment.selection import visible_part
from grader.checks.check import Subject
from grader.errors import GraderFault
from grader.findings.finding import Evidence, Finding, Moment, Plot, Table
from grader.grade import judge_all
from grader.recording.submission import SourceError
from grader.report import formats
from grader.report.audience import RENDERERS, Audience, for_student
from grader.report.formats import gradescope
from grader.report.formats.foxglove import render_layout
from grader.report.formats.gradebook import grades_csv
from grader.report.html.report import render_report
from grader.report.model.class_row import ClassRow
from grader.report.model.result import result_json
from grader.report.text.explanation import headline
from tests.grade.sample import FAIL, Told, make_loaded, make_submission
from tests.report.sample import Sample, judged, make_facts, make_run

SECRET = "zq"
"""In every text of a hidden check, and in no other."""
SCENARIOS = ("listen", "zqhard")
MODULES = [
    import_module(f"{formats.__name__}.{one.name}") for one in iter_modules(formats.__path__)
]
HOSTILE = "\x1b[31mred\x00\u202e\x85\ufffe"


def say(status, mark):
    text = f"{mark}said"
    evidence = Evidence(
        moments=(Moment(text, 0.5),),
        places=(SourceError(f"{text}.py", 3, text),),
        log=(text,),
        plots=(Plot(text, text, text, (0.0, 1.0), (0.0, 2.0)),),
        tables=(Table(text, (text,), ((text,),)),),
    )
    return {
        "crashed": ValueError(text),
        "passed": Finding.passed(text, text, evidence),
        "failed": Finding.failed(text, text, text, evidence),
        "error": Finding.error(text, text, hint=text),
    }[status]


def hidden(name, points):
    return Told(name, points=points, visibility="hidden")


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


def whole(loaded):
    runs = recordings()
    facts = make_facts(recordings={name: f"recordings/{name}.mcap" for name in runs})
    return Sample(judge_all(loaded, make_submission(), runs), runs, facts)


def visible_alone(loaded):
    """What ``check`` makes for a student: of the visible part of an assignment."""
    part = visible_part(loaded)
    runs = {scenario.id: recordings()[scenario.id] for scenario in part.assignment.scenarios}
    return dataclasses.replace(
        whole(loaded), grade=judge_all(part, make_submission(), runs), recordings=runs
    )


def formats_of(result):
    """Every text that is made for students from a whole result."""
    copy = for_student(result)
    yield result_json(copy)
    yield grades_csv([ClassRow(copy.submission.id, result=copy)])
    for render, audience in RENDERERS.items():
        with suppress(GraderFault):
            yield str(render(result if audience is Audience.STUDENT else copy))
    data = json.loads(gradescope.render(result))
    # Gradescope itself hides the others.
    data["tests"] = [test for test in data["tests"] if test["visibility"] == "visible"]
    yield json.dumps(data)


@settings(max_examples=60, deadline=None)
@given(assignments())
def test_no_string_of_a_hidden_check_is_in_anything_for_students(loaded):
    sample, alone = whole(loaded), visible_alone(loaded)
    copy = for_student(sample.result)
    for text in (
        *formats_of(sample.result),
        render_report(sample.grade, copy, sample.recordings),
        alone.printed(120),
        alone.html(),
        result_json(alone.result),
        render_layout(alone.recordings.values()),
    ):
        assert SECRET not in text


def test_every_format_declares_who_reads_it():
    renders = [module.render for module in MODULES if hasattr(module, "render")]
    assert renders
    assert {*renders} <= {*RENDERERS}


@pytest.mark.parametrize("render", RENDERERS)
def test_what_acts_on_a_screen_reaches_no_format(render):
    failed = Finding.failed(HOSTILE, HOSTILE, HOSTILE, Evidence(log=(HOSTILE,)))
    result = judged([Told("a", failed, title=HOSTILE)]).result
    named = result.submission.model_copy(update={"id": HOSTILE, "problem": HOSTILE})
    text = str(render(result.model_copy(update={"submission": named})))
    assert not {*"\x1b\x00\u202e\x85\ufffe"} & {*text}
    assert not any(escape in text for escape in ("\\u001b", "\\x1b", "\\u0000", "\\x00"))


@settings(max_examples=60, deadline=None)
@given(assignments())
def test_the_student_s_copy_is_what_the_visible_part_alone_gives(loaded):
    alone, copy = visible_alone(loaded).result, for_student(whole(loaded).result)
    # The same exception is raised again and again here, and its traceback grows.
    checks = tuple(check.model_copy(update={"traceback": ""}) for check in alone.checks)
    alone = alone.model_copy(update={"checks": checks})
    for name in ("score", "max_score", "graded", "first_to_fix", "checks", "withheld"):
        assert getattr(copy, name) == getattr(alone, name)
    assert {one.id for one in copy.scenarios} <= {one.id for one in alone.scenarios}
    assert not any(one.recording for one in copy.scenarios)


@settings(max_examples=30, deadline=None)
@given(assignments())
def test_the_student_s_report_shows_the_runs_that_visible_checks_judge(loaded):
    sample = whole(loaded)
    html = render_report(sample.grade, for_student(sample.result), sample.recordings)
    assert html.count('id="what-') == len(visible_alone(loaded).recordings)


def test_a_result_without_hidden_checks_is_its_own_copy():
    result = judged([Told("a"), Told("b")]).result
    assert for_student(result) is result
    assert result.withheld.checks == 0


@pytest.mark.parametrize(
    ("checks", "said"),
    [
        (
            [*(Told(f"c{n}") for n in range(8)), *(hidden(f"h{n}", 2) for n in range(3))],
            "8 of 8 visible checks passed; 3 hidden checks, 6 points, run at grading.",
        ),
        (
            [Told("a"), Told("b", FAIL), hidden("h", 0.5)],
            "1 check failed; 1 hidden check, 0.5 points, runs at grading.",
        ),
        ([Told("a"), Told("b", FAIL, points=0)], "Full points; 1 check without points failed."),
        (
            [Told("a"), Told("b", Finding.error("", ""), points=0)],
            "Full points; 1 check without points could not be judged.",
        ),
        ([Told("a", points=0), Told("b", FAIL, points=0)], "1 check failed."),
    ],
)
def test_the_headline_announces_hidden_checks_only_where_there_are_some(checks, said):
    assert headline(for_student(judged(checks).result)) == said
