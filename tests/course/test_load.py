"""``course.yaml``: what can be written, and what each contradiction is answered with."""

from __future__ import annotations

from datetime import datetime, timezone
from pathlib import Path

import pytest

from grader.course.load import Course, load_course
from grader.course.model import CourseFile
from grader.errors import AssignmentError, UsageError
from grader.machine import resources
from grader.spec.document import parse_yaml

WHOLE = """\
title: Robotics 2026
time_zone: Europe/Berlin
late: {per: day, deduct: 10 %, grace: 15 min, at_most: 50 %}
tokens: {each: 3, worth: day}
attempts: {counts: best, at_most: 3}
assignments:
  timed_publisher: {due: 2026-10-12 23:59, closes: 2026-10-19 23:59, published: 2026-10-20 08:00}
  qos:
    due: 2026-10-26 23:59
    late: {per: hour, deduct: 0.5}
    attempts: {counts: last before the deadline}
groups: [[ana, ben], [cai, dora]]
extensions:
  - {student: ana, assignment: timed_publisher, due: 2026-10-14 23:59, reason: ill}
  - {student: ana, assignment: qos, days: 2}
  - {student: ben, assignment: qos, tokens: 2}
"""


def course(folder: Path, text: str = WHOLE) -> Course:
    """The rules in a text."""
    file = folder / "course.yaml"
    file.write_text(text, encoding="utf-8")
    return load_course(file)


def refused(folder: Path, old: str, new: str) -> str:
    """What a mistake in a course that is right otherwise is answered with, from the line on."""
    assert old in WHOLE
    with pytest.raises(AssignmentError) as caught:
        course(folder, WHOLE.replace(old, new, 1))
    return str(caught.value).replace(f"{folder}/", "")


def test_a_student_has_the_rules_of_the_assignment_and_the_own_extension(tmp_path: Path) -> None:
    rules = course(tmp_path)
    ana, ben = rules.rules("timed_publisher", " Ana "), rules.rules("timed_publisher", "ben")
    assert ana.due.isoformat() == "2026-10-14T23:59:00+02:00"
    assert ben.due.isoformat() == "2026-10-12T23:59:00+02:00"
    assert (ana.late, ana.attempts) == (rules.spec.late, rules.spec.attempts)
    # As a Mac writes the accent, and as a keyboard does.
    accent = course(
        tmp_path, WHOLE.replace("student: ana", "student: jose\N{COMBINING ACUTE ACCENT}")
    )
    assert accent.rules("timed_publisher", "Jos\N{LATIN SMALL LETTER E WITH ACUTE}").due == ana.due
    # The clocks were changed on the day before the due time.
    assert rules.rules("qos", "ana").due.isoformat() == "2026-10-28T23:59:00+01:00"
    assert rules.rules("qos", "ben").due == rules.rules("qos", "ana").due
    assert rules.rules("qos", "ben").late == rules.spec.assignments["qos"].late


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("time_zone: Europe/Berlin", "time_zone: Europe/Berlim", "Did you mean 'Europe/Berlin'?"),
        (
            "time_zone: Europe/Berlin\n",
            "",
            "course.yaml:6: assignments.timed_publisher.due: '2026-"
            "10-12 23:59' has no time zone: write `time_zone: Europe/Berlin` at the top",
        ),
        (
            "due: 2026-10-12 23:59",
            "due: 2026-10-12",
            "course.yaml:7: assignments.timed_publisher."
            "due: '2026-10-12' is not a date with a time of day",
        ),
        ("due: 2026-10-12 23:59", "due: 2026-13-12 23:59", "is not a date with a time of day"),
        (
            "due: 2026-10-26 23:59",
            "due: 2026-10-25 02:30",
            "course.yaml:9: assignments.qos.due: "
            "'2026-10-25 02:30' is there twice in Europe/Berlin, because the clocks are changed",
        ),
        (
            "due: 2026-10-26 23:59",
            "due: 2027-03-28 02:30",
            "'2027-03-28 02:30' does not exist in Europe/Berlin",
        ),
        (
            "closes: 2026-10-19 23:59",
            "closes: 2026-10-11 23:59",
            "course.yaml:7: assignments."
            "timed_publisher.closes: is before the due time, 2026-10-12 23:59",
        ),
        ("published: 2026-10-20 08:00", "published: 2026-10-01 08:00", "published: is before the"),
        (
            "assignment: qos",
            "assignment: qoss",
            "course.yaml:15: extensions[1].assignment: no "
            "assignment 'qoss' in this file. Did you mean 'qos'?",
        ),
        (
            "assignment: qos, days: 2",
            "assignment: timed_publisher, days: 2",
            "course.yaml:15: "
            "extensions[1]: ana has an extension for timed_publisher already (line 14)",
        ),
        ("days: 2", "days: 2, due: 2026-11-14 23:59", "extensions[1]: give either `due`, `days`"),
        (", days: 2", "", "extensions[1]: give either `due`, `days` or `tokens`"),
        ("tokens: 2}", "tokens: 4}", "course.yaml:16: extensions[2].tokens: ben uses 4 of 3 late"),
        ("tokens: {each: 3, worth: day}\n", "", "extensions[2].tokens: ben uses 2 of 0 late"),
        (
            "due: 2026-10-14 23:59",
            "due: 2026-10-10 23:59",
            "course.yaml:14: extensions[0].due: is "
            "not later than the due time of all, 2026-10-12 23:59",
        ),
        (
            "[cai, dora]",
            "[cai, Ana]",
            "course.yaml:12: groups[1][1]: 'Ana' is in a group already (line 12)",
        ),
        (
            "deduct: 10 %",
            "deduct: 110 %",
            "course.yaml:3: late.deduct: '110 %' is not a percentage",
        ),
        ("deduct: 10 %", "deduct: -1", "expected points (0.5) or a percentage of all points"),
        ("counts: best", "counts: bst", "expected 'best', 'last' or 'last before the deadline'"),
        ("grace: 15 min", "grace: 15", "late.grace: 15 has no unit"),
    ],
)
def test_a_contradiction_is_one_error_at_its_line(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    text = refused(tmp_path, old, new)
    assert said in text
    assert len(text.splitlines()) == 1


def test_an_assignment_without_rules_is_named_with_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no assignment 'qo'\. Did you mean 'qos'"):
        course(tmp_path).rules("qo", "ana")


@pytest.mark.parametrize(
    ("now", "shown"),
    [
        ("2026-10-13T00:00", {"visible"}),
        # Until the assignment closes for all, and for who has an extension.
        ("2026-10-19T21:59", {"visible"}),
        ("2026-10-19T22:00", {"visible", "after_due_date"}),
        ("2026-10-20T06:00", {"visible", "after_due_date", "after_published"}),
    ],
)
def test_hidden_checks_are_shown_when_nobody_can_hand_in_any_more(
    tmp_path: Path, now: str, shown: set[str]
) -> None:
    moment = datetime.fromisoformat(now).replace(tzinfo=timezone.utc)
    assert course(tmp_path).visible("timed_publisher", moment) == shown


def test_the_example_of_the_documentation_is_valid(tmp_path: Path) -> None:
    text = (resources.root() / "docs" / "course.md").read_text(encoding="utf-8")
    example = text.split("```yaml\n")[1].split("```")[0]
    assert course(tmp_path, example).rules("qos", "CAI").due.isoformat().startswith("2026-10-28")
    schema = CourseFile.model_json_schema()
    assert set(parse_yaml(example, tmp_path)[0]) <= set(schema["properties"])
