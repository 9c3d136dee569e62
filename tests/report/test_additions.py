"""What persons and rules add to a result, in every format that a student or a system reads."""

import csv
import io
import json
from dataclasses import replace
from xml.etree import ElementTree

import pytest

from grader.findings.finding import Status
from grader.report.formats import github, gradescope, junit
from grader.report.formats.canvas_gradebook import canvas_csv, read_canvas
from grader.report.formats.gradebook import grades_csv
from grader.report.formats.markdown import render_markdown
from grader.report.html.overview import render_overview
from grader.report.model.class_row import ClassRow
from grader.report.model.cluster import clusters
from tests.report.sample import full_points, lost_points, reviewed

LINES = (
    "README: 1.5 of 2 points, by AB: as agreed",
    "forgiven: as agreed: +0.5 points, by AB: as agreed",
    "as agreed: −1 point: as agreed",
)
COMMENT = "AB (as agreed:3): as agreed"
WAITS = "Oral exam (3 points) waits for a person"


def sample(*, waits=False):
    """3 points of the checks, and 1 more of 2."""
    added = reviewed("as agreed", waits=waits)
    return replace(full_points(), added=_by_ab(added))


def _by_ab(added):
    return {
        name: tuple(one.model_copy(update={"by": "AB"} if one.by else {}) for one in parts)
        for name, parts in added.items()
    }


def formats(made):
    result = made.result
    return {
        "terminal": " ".join(made.printed(width=200).split()),
        "markdown": render_markdown(result),
        "github": github.summary(result),
        "gradescope": json.loads(gradescope.render(result))["output"],
    }


@pytest.mark.parametrize("name", ["terminal", "markdown", "github", "gradescope"])
def test_each_format_shows_the_final_score_and_every_line_of_it(name):
    text = formats(sample())[name]
    assert "4 of 5 points" in text
    for line in (*LINES, COMMENT):
        assert line in text, line


@pytest.mark.parametrize("name", ["terminal", "markdown", "github", "gradescope"])
def test_points_that_a_person_has_not_given_yet_are_named(name):
    assert f"4 of 8 points so far; {WAITS}" in formats(sample(waits=True))[name]


def test_a_report_marks_the_words_of_a_person():
    page = sample(waits=True).html()
    for text in (*LINES, "The checks: 3 of 3 points", WAITS, "written by AB, on <code>"):
        assert text in page, text
    assert "How the points add up" not in full_points().html()


def test_systems_get_the_final_score():
    result = sample().result
    assert json.loads(gradescope.render(result))["score"] == 4.0
    properties = ElementTree.fromstring(junit.render(result)).iter("property")
    found = {one.get("name"): one.get("value") for one in properties}
    assert (found["score"], found["max_score"]) == ("4", "5")
    assert found["adjustment.1"] == LINES[0]
    assert "score<<x\n4\nx" in github.outputs(result, "x")


def test_grades_csv_has_columns_for_items_and_adjustments():
    rows = [
        ClassRow("ana", result=sample().result),
        ClassRow("ben", result=sample(waits=True).result),
        ClassRow("cai", missing=True),
    ]
    ana, ben, cai = csv.DictReader(io.StringIO(grades_csv(rows)))
    columns = (
        "status",
        "score",
        "max_score",
        "readme (2)",
        "forgiven points",
        "late points",
        "oral (3)",
    )
    assert [ana[one] for one in columns] == ["graded", "4", "5", "1.5", "0.5", "-1", ""]
    assert [ben[one] for one in columns] == [
        *("waits for a person", "", "8", "1.5", "0.5", "-1", ""),
    ]
    assert cai["readme (2)"] == cai["late points"] == cai["late"] == ""


def test_canvas_gets_no_score_while_a_person_has_to_give_points():
    export = read_canvas(
        "Student,ID,SIS Login ID,Section,timed_publisher (7)\n"
        "    Points Possible,,,,5\n"
        "Ana,1,ana,S,\n"
        "Ben,2,ben,S,\n"
    )
    ana, ben = sample().result, sample(waits=True).result
    filled = canvas_csv([ClassRow("ana", result=ana), ClassRow("ben", result=ben)], export)
    assert list(filled.scored) == ["ana"]
    assert filled.problems == ("ben: waits for a person (Oral exam), so the cell is left as it is",)


def test_the_overview_shows_who_waits_and_who_made_the_same_mistake():
    rows = [
        ClassRow("ana", "Ana", report="ana/report.html", result=lost_points().result),
        ClassRow("ben", "Ben", report="ben/report.html", result=lost_points().result),
        ClassRow("cai", "Cai", report="cai/report.html", result=sample(waits=True).result),
    ]
    page = render_overview(rows, clusters(rows), ("zoe",))
    assert "1 submission waits for points by a person" in page
    assert "4 + ?" in page
    example = rows[0].result.of(Status.FAILED)[0].observed
    assert f"for example: {example}" in page
    assert '<a href="./ben/report.html#check-period">Ben</a>' in page
    assert "zoe. The files stay in <code>review/</code>" in page
