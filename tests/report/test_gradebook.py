"""Gradebooks as Canvas and as a spreadsheet read them."""

from __future__ import annotations

import csv
import io

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grader.errors import UsageError
from grader.grade import grade
from grader.report.gradebook import canvas_csv, cell, plain_csv, read_canvas
from grader.report.result import make_result
from tests.grade.sample import Told, make_loaded, make_recording, make_submission
from tests.report.sample import full_points, lost_points, make_facts, not_graded

EXPORT = """\
Student,ID,SIS User ID,SIS Login ID,Section,ROS 2 Publisher (48211),Final Score
    Points Possible,,,,,10,(read only)
"Lopez, Ana",90211,s1001,alopez,Sec 1,9.5,14
"Ng, Wei",90212,s1002,wng,"Sec 1, =x",,
"Ng, Wei",90213,s1003,wng2,Sec 2,EX,
"Student, Test",90300,,,Sec 1,,
"""


def result(name, make=full_points):
    sample = make()
    found = make_result(sample.grade, sample.recordings, sample.facts)
    return found.model_copy(update={"submission": found.submission.model_copy(update={"id": name})})


def rows(text):
    return list(csv.reader(io.StringIO(text)))


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


def fill(results, export=EXPORT, column="ROS 2 Publisher"):
    return canvas_csv(results, read_canvas(export), column)


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
        "lopezana_90211",
    ],
)
def test_a_student_is_found_by_what_canvas_knows(name):
    filled = fill([result(name)])
    assert canvas_reads(filled.text) == {"90211": {"ROS 2 Publisher (48211)": "3"}}
    assert filled.problems == ()


def test_a_number_behind_another_name_is_nobody():
    with pytest.raises(UsageError, match="team_90211: not matched"):
        fill([result("team_90211")])


def test_a_quote_that_never_ends_is_told():
    with pytest.raises(UsageError, match=r"gb\.csv: is not CSV: field larger"):
        read_canvas('Student,ID,Section\n"' + "x," * 100_000, "gb.csv")


def test_a_late_download_is_found_too():
    assert fill([result("lopezana_LATE_90211_77_hw.zip")]).filled == 1


def test_identity_is_kept_and_others_are_not_touched():
    filled = fill([result("90212")])
    header, points, student = rows(filled.text)
    assert header == [*EXPORT.splitlines()[0].split(",")[:5], "ROS 2 Publisher (48211)"]
    assert points == ["    Points Possible", "", "", "", "", "10"]
    assert student == ["Ng, Wei", "90212", "s1002", "wng", "Sec 1, =x", "3"]


def test_the_points_of_canvas_are_kept_and_others_are_told():
    # With another number in this row Canvas changes the assignment.
    filled = fill([result("90212")], EXPORT)
    assert rows(filled.text)[1][-1] == "10"
    assert filled.doubts == (
        "ROS 2 Publisher (48211) has 10 points in Canvas and 3 here; the scores are filled in as "
        "they are",
    )
    assert fill([result("90212")], EXPORT.replace(",10,", ',"3,00",')).doubts == ()


def test_a_column_that_is_new_to_canvas_is_told():
    filled = fill([result("90212")], column="ROS2 Publisher")
    assert filled.doubts == (
        "the gradebook has no column 'ROS2 Publisher': Canvas will offer to make a new assignment "
        "of it. Did you mean 'ROS 2 Publisher'?",
    )
    (told,) = fill([result("90212")], EXPORT.replace("ROS 2 Publisher (48211)", "Essay")).doubts
    assert told.endswith("a new assignment of it. There are: Essay.")


def test_a_column_that_canvas_would_skip_is_refused():
    locked = EXPORT.replace(",10,", ",(read only),")
    with pytest.raises(UsageError, match=r"Canvas skips the column 'ROS 2 Publisher \(48211\)'"):
        fill([result("90212")], locked)


def test_whoever_has_no_score_is_listed_with_the_reason():
    filled = fill(
        [
            result("90211", lost_points),
            result("90212", not_graded),
            result("nobody"),
            result("Ng, Wei"),
            result("alopez"),
            result("90213"),
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


def test_where_nobody_fits_nothing_is_written():
    with pytest.raises(UsageError, match="no score could be filled in:\nnobody: not matched"):
        fill([result("nobody")])


def test_a_column_that_canvas_does_not_know_is_made():
    filled = fill([result("90211")], column=None)
    assert canvas_reads(filled.text) == {"90211": {"timed_publisher": "3"}}


@pytest.mark.parametrize(
    "title",
    ["Final Score", "Current Points", "Override Grade", "My Unposted Final Grade", "finals"],
)
def test_a_title_that_canvas_would_drop_is_refused(title):
    with pytest.raises(UsageError, match="Canvas drops a column called"):
        fill([result("90211")], column=title)


def test_a_title_that_stands_twice_must_be_named_whole():
    twice = EXPORT.replace("Final Score", "ROS 2 Publisher (5)").replace("(read only)", "10")
    with pytest.raises(UsageError, match=r"several times: .*\(48211\), ROS 2 Publisher \(5\)"):
        fill([result("90211")], twice)
    assert fill([result("90211")], twice, "ROS 2 Publisher (5)").filled == 1


def test_semicolons_and_a_byte_order_mark_are_read():
    lines = [row.replace(",", ";") for row in EXPORT.splitlines() if '"' not in row]
    text = "\ufeff" + "\n".join([*lines, '"Lopez, Ana";90211;s1001;alopez;Sec 1;9,5;'])
    assert canvas_reads(fill([result("alopez")], text).text)["90211"]


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


@pytest.mark.parametrize(
    "header",
    [
        "Student,ID,Section,A",
        "Student,ID,SIS Login ID,Section,A",
        "Student,ID,SIS User ID,SIS Login ID,Integration ID,Root Account,Section,A",
    ],
)
def test_what_canvas_accepts_is_accepted(header):
    assert read_canvas(f"{header}\n").columns == ("A",)


def test_the_plain_csv_has_a_column_for_each_check():
    text = plain_csv([result("ada", lost_points), result("bob", lost_points)])
    assert rows(text)[:2] == [
        [
            *("submission", "score", "max_score", "graded"),
            *("builds (1)", "period (3)", "steady (2)", "ends (1)"),
        ],
        ["ada", "3.02", "7", "yes", "1", "1.02", "0", "1"],
    ]


def test_what_is_not_graded_has_no_score_in_it():
    header, row = rows(plain_csv([result("ada", not_graded)]))
    assert dict(zip(header, row, strict=True)) == {
        "submission": "ada",
        "score": "",
        "max_score": "4",
        "graded": "no",
        "node (2)": "2",
        "depth (1)": "",
        "period (1)": "",
    }


def test_results_of_two_assignments_are_not_mixed():
    other = result("bob")
    other = other.model_copy(
        update={"assignment": other.assignment.model_copy(update={"id": "qos"})}
    )
    with pytest.raises(UsageError, match="several assignments: qos, timed_publisher"):
        plain_csv([result("ada"), other])
    with pytest.raises(UsageError, match="there is no result"):
        plain_csv([])


@settings(deadline=None)
@given(st.text(max_size=20))
def test_no_cell_is_a_formula(text):
    assert not cell(text).lstrip().startswith(("=", "+", "-", "@"))
    assert not cell(f"\N{FULLWIDTH EQUALS SIGN}{text}").startswith("\N{FULLWIDTH EQUALS SIGN}")
    loaded = make_loaded([Told("a")])
    found = make_result(
        grade(loaded, make_submission(id=text), {"listen": make_recording()}), {}, make_facts()
    )
    read = rows(plain_csv([found]))
    assert len(read) == 2 and len({len(row) for row in read}) == 1
    assert not read[1][0].lstrip().startswith(("=", "+", "-", "@"))
