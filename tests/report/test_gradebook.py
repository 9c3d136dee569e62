"""Gradebooks as Canvas and as a spreadsheet read them."""

from __future__ import annotations

import csv
import io

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grader.errors import UsageError
from grader.report.formats.canvas_gradebook import canvas_csv, read_canvas
from grader.report.formats.gradebook import cell, csv_text, grades_csv
from grader.report.model.class_row import ClassRow
from tests.grade.sample import Told, make_submission
from tests.report.sample import full_points, judged, lost_points, not_graded

EXPORT = """\
Student,ID,SIS User ID,SIS Login ID,Section,ROS 2 Publisher (48211),Final Score
    Points Possible,,,,,10,(read only)
"Lopez, Ana",90211,s1001,alopez,Sec 1,9.5,14
"Ng, Wei",90212,s1002,wng,"Sec 1, =x",,
"Ng, Wei",90213,s1003,wng2,Sec 2,EX,
"Student, Test",90300,,,Sec 1,,
"""


def result(name, make=full_points):
    found = make().result
    return found.model_copy(update={"submission": found.submission.model_copy(update={"id": name})})


def row(key, make=full_points, **changes):
    return ClassRow(key, result=result(key, make), **changes)


def unreadable(name):
    found = result(name, lost_points)
    part = found.submission.model_copy(update={"problem": "a.zip: is broken"})
    return ClassRow(name, result=found.model_copy(update={"submission": part, "score": 0.0}))


def missing(name):
    return ClassRow(name, missing=True)


def rows(text):
    return list(csv.reader(io.StringIO(text)))


def records(text):
    return list(csv.DictReader(io.StringIO(text)))


def canvas_reads(text):
    """A gradebook by the rules of Canvas' importer: {user id: {assignment: points}}."""
    header, *body = rows(text)
    assert "Student" in header[0] and "ID" in header[1] and len(header) > 3
    section = next(n for n, title in enumerate(header) if "Section" in title)
    assert all(len(row) == len(header) for row in body)
    points = next(row for row in body if "Points Possible" in row[0])
    float(points[-1])
    return {
        row[1]: dict(zip(header[section + 1 :], row[section + 1 :], strict=True))
        for row in body
        if row is not points
    }


def fill(class_rows, export=EXPORT, column="ROS 2 Publisher"):
    return canvas_csv(class_rows, read_canvas(export), column)


@pytest.mark.parametrize(
    "name",
    [
        "90211",
        "s1001",
        "alopez",
        "Lopez, Ana",
        "Ana Lopez",
        "ana_lopez",
        "lopezana_90211_77_hw.zip",
        "lopezana_LATE_90211_77_hw.zip",
        "lopezana_90211",
    ],
)
def test_a_student_is_found_by_what_canvas_knows(name):
    filled = fill([row(name)])
    assert canvas_reads(filled.text) == {"90211": {"ROS 2 Publisher (48211)": "3"}}
    # The other student of the gradebook handed in nothing.
    assert [problem.partition(":")[0] for problem in filled.problems] == ["Ng, Wei (90212)"]


def test_a_quote_that_never_ends_is_reported():
    with pytest.raises(UsageError, match=r"gb\.csv: is not CSV: field larger"):
        read_canvas('Student,ID,Section\n"' + "x," * 100_000, "gb.csv")


TITLE = "ROS 2 Publisher (48211)"
TWICE = EXPORT.replace("Final Score", "ROS 2 Publisher (5)").replace("(read only)", "10")


@pytest.mark.parametrize(
    ("name", "export", "column", "said"),
    [
        ("team_90211", EXPORT, TITLE, "no score could be filled in:\nteam_90211: not matched"),
        ("90211", EXPORT.replace(",10,", ",(read only),"), TITLE, "Canvas skips the column"),
        ("90211", TWICE, "ROS 2 Publisher", r"several times: .*\(48211\), ROS 2 Publisher \(5\)"),
        *(
            ("90211", EXPORT, title, "Canvas drops the column")
            for title in ("Final Score", "Current Points", "Override Grade", "My Unposted finals")
        ),
    ],
)
def test_what_canvas_would_skip_or_drop_is_refused(name, export, column, said):
    with pytest.raises(UsageError, match=said):
        fill([row(name)], export, column)


def test_results_of_two_assignments_are_not_mixed():
    other = result("bob")
    part = other.assignment.model_copy(update={"id": "qos"})
    rows_of_two = [
        row("ada"),
        ClassRow("bob", result=other.model_copy(update={"assignment": part})),
    ]
    with pytest.raises(UsageError, match="several assignments: qos, timed_publisher"):
        grades_csv(rows_of_two)
    with pytest.raises(UsageError, match="there is no result"):
        fill([missing("ada")])


@pytest.mark.parametrize(
    ("export", "column", "doubts"),
    [
        # With another number in this row Canvas changes the assignment.
        (EXPORT, TITLE, [f"{TITLE} has 10 points in Canvas and 3 here; the scores are filled in"]),
        (EXPORT.replace(",10,", ',"3,00",'), TITLE, []),
        (EXPORT, "ROS2 Publisher", ["the gradebook has no column 'ROS2 Publisher': Canvas will"]),
        (
            EXPORT,
            None,
            ["the gradebook has no column 'timed_publisher': Canvas will offer to make"],
        ),
    ],
)
def test_the_points_of_canvas_are_kept_and_what_is_odd_is_reported(export, column, doubts):
    filled = fill([row("90212")], export, column)
    assert rows(filled.text)[1][-1] in ("10", "3,00", "3")
    assert [told[: len(doubt)] for told, doubt in zip(filled.doubts, doubts, strict=True)] == doubts


def test_identity_is_kept_and_others_are_not_touched():
    filled = fill([row("90212")])
    header, points, student = rows(filled.text)
    assert header == [*EXPORT.splitlines()[0].split(",")[:5], "ROS 2 Publisher (48211)"]
    assert points == ["    Points Possible", "", "", "", "", "10"]
    assert student == ["Ng, Wei", "90212", "s1002", "wng", "Sec 1, =x", "3"]


def test_a_student_without_a_score_is_listed_with_the_reason():
    filled = fill(
        [
            row("90211", lost_points),
            row("90212", not_graded),
            row("nobody"),
            row("Ng, Wei"),
            row("alopez"),
            row("90213"),
        ]
    )
    assert canvas_reads(filled.text) == {"90211": {"ROS 2 Publisher (48211)": "3.02"}}
    assert filled.problems == (
        "90212: not graded, so the cell is left as it is",
        "nobody: not matched, no student of that name or number in the gradebook",
        "Ng, Wei: not matched, several students in the gradebook",
        "alopez: the same student as 90211, left out",
        "90213: excused in Canvas, so the cell is left as it is",
    )


def test_semicolons_and_a_byte_order_mark_are_read():
    lines = [row.replace(",", ";") for row in EXPORT.splitlines() if '"' not in row]
    text = "\ufeff" + "\n".join([*lines, '"Lopez, Ana";90211;s1001;alopez;Sec 1;9,5;'])
    assert canvas_reads(fill([row("alopez")], text).text)["90211"]


@pytest.mark.parametrize(
    "header",
    [
        "",
        "Name,ID,Section,A",
        "Student,Number,Section,A",
        "Student,ID,A",
        "Student,ID,SIS User ID,Section,A",
        "Student,ID,SIS Login ID,SIS User ID,Section,A",
        "Student,ID,Email,Section,A",
    ],
)
def test_what_canvas_would_refuse_is_refused(header):
    with pytest.raises(UsageError, match=r"export\.csv: not a gradebook of Canvas"):
        read_canvas(f"{header}\nAda,1,s,Sec,1\n", "export.csv")


def test_the_plain_csv_has_a_column_for_each_check():
    text = grades_csv([row("ada", lost_points, name="Ada", late=True, note="n")])
    assert rows(text) == [
        [
            *("submission", "name", "late", "status", "score", "max_score", "graded"),
            *("builds (1)", "period (3)", "steady (2)", "ends (1)", "note"),
        ],
        ["ada", "Ada", "yes", "graded", "3.02", "7", "yes", "1", "1.02", "0", "1", "n"],
    ]


def test_what_is_not_graded_has_no_score_in_it():
    (found,) = records(grades_csv([row("ada", not_graded)]))
    assert (found["status"], found["score"], found["graded"]) == ("not graded", "", "no")
    assert (found["node (2)"], found["depth (1)"], found["max_score"]) == ("2", "", "4")


def test_no_score_is_written_for_what_was_never_run():
    never_run = [unreadable("90211"), missing("wng"), row("90213")]
    found = records(grades_csv(never_run))
    assert [(one["status"], one["graded"], one["score"]) for one in found] == [
        *(("unreadable", "no", ""), ("missing", "no", ""), ("graded", "yes", "3"))
    ]
    filled = fill(never_run, EXPORT.replace("EX", ""))
    said = canvas_reads(filled.text)
    scores = [said.get(key, {}).get(TITLE, "") for key in ("90211", "90212", "90213")]
    assert scores == ["", "", "3"]
    assert filled.problems == (
        "90211: unreadable (a.zip: is broken), so the cell is left as it is",
        "wng: handed in nothing, so the cell is left as it is",
    )


def test_students_of_the_gradebook_without_any_row_handed_in_nothing():
    filled = fill([row("90212")])
    # The test student is no person, and an excused student owes nothing.
    (problem,) = filled.problems
    assert problem == "Lopez, Ana (90211): handed in nothing, so the cell is left as it is"


def test_a_grade_goes_before_what_could_not_be_read():
    both = [unreadable("90211"), row("alopez")]
    assert canvas_reads(fill(both).text)["90211"] == {"ROS 2 Publisher (48211)": "3"}


@pytest.mark.parametrize("text", ["a;=b", "a\tb", 'a"b', "a,b", "a\r\nb"])
def test_a_cell_stays_one_cell_whatever_separates_cells_in_the_reader_s_country(text):
    written = csv_text([["x", text]])
    assert written.startswith('x,"')
    assert rows(written) == [["x", text]]


@settings(deadline=None)
@given(st.text(max_size=20))
def test_no_cell_is_a_formula(text):
    assert not cell(text).lstrip().startswith(("=", "+", "-", "@"))
    assert not cell(f"\N{FULLWIDTH EQUALS SIGN}{text}").startswith("\N{FULLWIDTH EQUALS SIGN}")
    found = judged([Told("a")], submission=make_submission(id=text)).result
    read = rows(grades_csv([ClassRow(text, name=text, result=found, note=text)]))
    assert len(read) == 2 and len({len(row) for row in read}) == 1
    for said in (*read[1][:2], read[1][-1]):
        assert not said.lstrip().startswith(("=", "+", "-", "@"))
