"""The rules of a course in a batch: from what platforms give an instructor to lines of reports."""

from __future__ import annotations

import csv
import os
import shutil
import subprocess
import zipfile
from collections.abc import Mapping
from concurrent.futures import Future
from datetime import datetime, timezone
from html import unescape
from pathlib import Path

import pytest

from grader.assignment.load import LoadedAssignment, load_assignment
from grader.batch.batch import Batch, Done
from grader.batch.groups import regroup, unknown_students
from grader.batch.intake import collect
from grader.batch.ledger import Entry, Ledger
from grader.batch.roster import parse_roster
from grader.errors import UsageError
from grader.gradebook.adjusting import course_of
from grader.gradebook.class_files import read_class, standing, write_class
from grader.gradebook.class_regrading import bring_up_to_date, regrade_class
from grader.grading.files import REPORT_FILE, RESULT_FILE, STUDENT_FILE, write_graded
from grader.grading.graded import RECORDINGS_FOLDER, SUBMISSION_FILE
from grader.grading.regrading import find_recordings, regrade
from grader.recording.model import to_json
from grader.recording.submission import PackageRecord, SubmissionRecord
from grader.report.audience import for_student
from grader.report.files import write_whole
from grader.report.model.class_row import ClassRow
from grader.report.model.facts import Clock
from grader.review.model import Given, StudentReview
from grader.review.store import ReviewStore
from grader.submission.intake.locate import opened
from grader.submission.prepare import fingerprint

YAML = """\
rosgrade: 1
id: lesson
title: Test
packages: [{name: bot, executables: [bot]}, {name: extra, executables: [extra]}]
scenarios:
  - {id: run, launch: [{package: bot, executable: bot}], timeout: 5 s}
checks:
  - {id: package, uses: package.found, with: {package: bot}, points: 6}
  - {id: extra, uses: package.found, with: {package: extra}, points: 2}
  - {id: secret, uses: package.found, with: {package: bot}, points: 2, visibility: after_due_date}
"""
COURSE = """\
title: Robotics
time_zone: Europe/Berlin
assignments: {lesson: {due: 2026-10-12 23:59}}
late: {per: day, deduct: 10 %}
"""
NOW = datetime(2026, 10, 12, 12, 0, tzinfo=timezone.utc)


class Reader:
    """Grades by the packages in a submission; nothing is built or run."""

    capacity = 1

    def __init__(self, loaded: LoadedAssignment) -> None:
        self._loaded = loaded

    def submit(self, key: str, path: Path, folder: Path, given: Mapping[str, str]) -> Future[None]:
        """Grade at once."""
        with opened(path) as located:
            found = sorted(file.parent.name for file in located.root.rglob("package.xml"))
        packages = tuple(PackageRecord(name, name) for name in found)
        record = SubmissionRecord(key, fingerprint(path), packages=packages)
        (folder / RECORDINGS_FOLDER).mkdir()
        write_whole(folder / RECORDINGS_FOLDER / SUBMISSION_FILE, to_json(record))
        write_graded(regrade(self._loaded, find_recordings(folder)), folder, Clock())
        done: Future[None] = Future()
        done.set_result(None)
        return done

    def close(self) -> None:
        """There is nothing to end."""


class Class:
    """A class and the rules of its course."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "lesson").mkdir()
        (folder / "lesson" / "assignment.yaml").write_text(YAML, encoding="utf-8")
        self.loaded = load_assignment(folder / "lesson")
        self.name = "lesson"
        self.out = folder / "out"
        self.handed = folder / "class"
        self.handed.mkdir()
        self.rules(COURSE)

    def rules(self, text: str) -> None:
        """Write course.yaml."""
        (self.folder / "course.yaml").write_text(text, encoding="utf-8")

    def reported(self) -> dict[str, ClassRow]:
        """Apply the rules again to what is graded, as ``rosgrade report OUT`` does."""
        rules = course_of(self.out, None, self.name)
        assert rules is not None
        with Ledger(self.out).opened() as ledger:
            regroup(ledger, rules)
        return {row.id: row for row in read_class(self.out)}

    def entries(self) -> dict[str, Entry]:
        """The rows as they are written down."""
        return {one.key: one for one in Ledger(self.out).read().entries}

    def hand_in(self, name: str, *packages: str, text: str = "") -> Path:
        """A folder, or a zip, with the names of packages."""
        target = self.handed / name
        target.parent.mkdir(parents=True, exist_ok=True)
        files = {f"{one}/package.xml": "<package/>" for one in packages}
        files["notes.txt"] = text
        if name.endswith(".zip"):
            with zipfile.ZipFile(target, "w") as made:
                for file, content in files.items():
                    made.writestr(file, content)
            return target
        for file, content in files.items():
            (target / file).parent.mkdir(parents=True, exist_ok=True)
            (target / file).write_text(content)
        return target

    def grade(
        self, roster: str = "", now: datetime = NOW, handed: Path | None = None
    ) -> dict[str, ClassRow]:
        """Run a batch as the command does; the rows as everything else reads them then.

        With ``handed`` go on with the class, by what is in that folder: ``rosgrade batch OUT NEW``.
        """
        course = course_of(self.out, self.folder / "course.yaml", self.name)
        known = parse_roster(roster, "class.csv") if roster else None
        staging = self.folder / f"staging{len(list(self.folder.iterdir()))}"
        staging.mkdir()
        with Ledger(self.out).opened() as ledger:
            place = str(course.file.resolve()) if course else None
            batch = Batch(self.loaded, ledger, course=place, keep=handed is not None)
            _, to_do = batch.read(collect(handed or self.handed, staging, known, course=course))
            done: list[Done] = list(batch.grade(to_do, Reader(self.loaded)))
            write_class(bring_up_to_date(done, ledger, now), ledger)
        return {row.id: row for row in read_class(self.out)}


def lines(row: ClassRow) -> list[tuple[str, float | None]]:
    """Adjustments of a row."""
    assert row.result is not None
    return [(one.kind, one.points) for one in row.result.adjustments]


@pytest.fixture
def course(tmp_path: Path) -> Class:
    return Class(tmp_path)


def test_an_assignment_that_was_edited_in_place_grades_nobody_beside_the_others(
    course: Class,
) -> None:
    course.hand_in("ana", "bot")
    course.grade()
    yaml = course.folder / "lesson" / "assignment.yaml"
    yaml.write_text(YAML.replace("points: 6", "points: 7"))
    course.loaded = load_assignment(yaml.parent)
    course.handed = course.folder / "new"
    course.hand_in("ben", "bot", text="ben")
    with pytest.raises(UsageError, match=r"1 \(ana\) graded with another version") as refused:
        course.grade(handed=course.handed)
    # Neither of these would change anything.
    assert "`rosgrade batch" not in str(refused.value) and "--retry" not in str(refused.value)
    assert f"`rosgrade regrade {course.out} {yaml.parent}`" in str(refused.value)
    assert set(course.entries()) == {"ana"}
    with Ledger(course.out).opened() as ledger:
        list(regrade_class(course.loaded, ledger))
    rows = course.grade(handed=course.handed)
    versions = {one.result.assignment.sha256 for one in rows.values() if one.result}
    assert set(rows) == {"ana", "ben"} and versions == {course.loaded.sha256}


def test_gradescope_s_times_cost_what_the_rules_say(course: Class) -> None:
    course.hand_in("submission_1", "bot")
    course.hand_in("submission_2", "bot", text="ben")
    (course.handed / "submission_metadata.yml").write_text(
        "submission_1:\n  :submitters:\n  - :name: Ana\n"
        "  :created_at: 2026-10-12 22:20:00.567158000 Z\n"
        "submission_2:\n  :submitters:\n  - :name: Ben\n  :created_at: 2026-10-12 21:59:59 Z\n"
    )
    rows = course.grade()
    assert lines(rows["Ana"]) == [("late", -1)] and lines(rows["Ben"]) == []
    assert (rows["Ana"].score, rows["Ben"].score) == (7, 8)
    entries = {one.key: one for one in Ledger(course.out).read().entries}
    assert entries["Ana"].handed_in == "2026-10-12T22:20:00+00:00"
    report = unescape((Ledger(course.out).folder("Ana") / REPORT_FILE).read_text())
    assert "handed in 2026-10-13 00:20 Europe/Berlin by Gradescope's metadata, 21 min" in report
    with (course.out / "grades.csv").open(newline="") as stream:
        ana = next(csv.DictReader(stream))
    assert [ana[one] for one in ("late", "score", "late points")] == ["yes", "7", "-1"]


def test_without_rules_nothing_is_deducted_and_the_times_are_kept(course: Class) -> None:
    (course.folder / "course.yaml").unlink()
    course.hand_in("ana_2030-01-01T10-00-00Z", "bot")
    with Ledger(course.out).opened() as ledger:
        batch = Batch(course.loaded, ledger)
        _, to_do = batch.read(collect(course.handed, course.folder))
        done = list(batch.grade(to_do, Reader(course.loaded)))
        write_class(bring_up_to_date(done, ledger, NOW), ledger)
        (entry,) = ledger.read().entries
    (row,) = read_class(course.out)
    assert lines(row) == [] and row.score == 8
    assert (entry.handed_in, entry.handed_in_from) == (
        "2030-01-01T10:00:00+00:00",
        "the name of the file",
    )


def test_who_canvas_calls_late_without_a_time_loses_nothing_and_has_a_note(course: Class) -> None:
    course.hand_in("lopezana_LATE_90211_1234_ws.zip", "bot")
    (row,) = course.grade().values()
    assert lines(row) == []
    assert "marked late, but not by how much, so nothing is deducted" in row.note


def test_a_name_that_the_student_chose_is_no_time(course: Class) -> None:
    course.hand_in("lopezana_90211_1234_ws_2026-10-14T10-00-00Z.zip", "bot")
    course.hand_in("Wei Ng_4711_assignsubmission_file_/ws_2026-10-14T10-00Z.zip", "bot", text="wei")
    # A number behind it is not an offset.
    course.hand_in("dee_2026-10-14-10-00-00-0100.zip", "bot", text="dee")
    rows = course.grade()
    assert [lines(row) for row in rows.values()] == [[], [], []]
    notes = "".join(row.note for row in rows.values())
    assert notes.count("handed in 2026-10-14 10:00 without a zone by the name of the file") == 1


def test_the_roster_says_when_and_goes_before_the_platform(course: Class) -> None:
    course.hand_in("lopezana_LATE_90211_1234_ws.zip", "bot")
    course.hand_in("ngwei_90212_1235_ws.zip", "bot", text="wei")
    course.hand_in("raybo_90213_1236_ws.zip", "bot", text="bo")
    rows = course.grade(
        "id,name,handed_in\n90211,Ana Lopez,2026-10-14 09:00+02:00\n90212,Wei Ng,2026-10-15 09:00\n"
        "90213,Bo Ray,yesterday\n"
    )
    assert lines(rows["90211"]) == [("late", -2)]
    assert lines(rows["90212"]) == lines(rows["90213"]) == []
    assert "without a zone by the roster, so nothing is deducted: a column" in rows["90212"].note
    assert "when it was handed in is not known: 'yesterday' is not a date" in rows["90213"].note


def commit(folder: Path, when: str, *config: str) -> None:
    """Make a repository of a folder, committed at a time."""
    own = {"GIT_COMMITTER_DATE": when, "GIT_AUTHOR_DATE": "2000-01-01T00:00:00Z"}
    named = ["-c", "user.name=Ana", "-c", "user.email=a@b.c"]
    for command in (["init", "-q"], ["add", "."], [*named, "commit", "-qm", "done"]):
        subprocess.run(["git", *command], cwd=folder, env=os.environ | own, check=True)
    for key in config:
        name, _, value = key.partition("=")
        subprocess.run(["git", "config", name, value], cwd=folder, check=True)


def test_a_repository_is_as_late_as_its_last_commit(course: Class) -> None:
    trap = course.folder / "trap"
    script = course.folder / "evil.sh"
    script.write_text(f"#!/bin/sh\ntouch {trap}\n")
    script.chmod(0o755)
    evil = f"={script}"
    commit(
        course.hand_in("ana", "bot"),
        "2026-10-13T00:30:00+02:00",
        *(f"{name}{evil}" for name in ("core.fsmonitor", "gpg.program", "core.sshCommand")),
        "log.showSignature=true",
    )
    (course.hand_in("ben", "bot", text="ben") / ".git").mkdir()
    rows = course.grade()
    assert lines(rows["ana"]) == [("late", -1)] and lines(rows["ben"]) == []
    assert rows["ana"].result is not None
    assert "by the committer date of git commit" in rows["ana"].result.adjustments[0].reason
    assert not trap.exists()


@pytest.mark.parametrize(("counts", "score"), [("best", 8), ("last", 6)])
def test_what_is_graded_again_is_an_attempt_and_the_rule_says_which_counts(
    course: Class, counts: str, score: int
) -> None:
    course.rules(f"{COURSE}attempts: {{counts: {counts}}}\n".replace("10 %", "4"))
    for at, packages in (
        ("2026-10-11T10:00Z", ["bot", "other"]),
        ("2026-10-11T11:00Z", []),
        ("2026-10-13T11:00Z", ["bot", "extra"]),
    ):
        shutil.rmtree(course.handed / "ana", ignore_errors=True)
        course.hand_in("ana", *packages)
        rows = course.grade(f"login,handed_in\nana,{at}\n")
    assert list(rows) == ["ana"]
    (result,) = [row.result for row in rows.values()]
    assert result is not None
    assert [(one.score, one.counts) for one in result.attempts] == [
        (8, counts == "best"),
        (0, False),
        (10, counts == "last"),
    ]
    assert rows["ana"].score == score
    assert result.attempts[0].handed_in == "2026-10-11T10:00:00+00:00"
    report = (Ledger(course.out).folder("ana") / REPORT_FILE).read_text()
    assert ("Attempt 1 of 3 counts (best)" in report) == (counts == "best")


def test_the_tenth_attempt_comes_after_the_ninth(course: Class) -> None:
    course.rules(f"{COURSE}attempts: {{counts: last, at_most: 10}}\n")
    for number in range(1, 12):
        shutil.rmtree(course.handed / "ana", ignore_errors=True)
        course.hand_in("ana", *(["bot"] * (number == 10)), text=str(number))
        row = course.grade()["ana"]
    assert row.result is not None
    assert [one.score for one in row.result.attempts] == [0] * 9 + [8, 0]
    assert row.score == 8


def test_a_week_later_the_better_grade_of_the_same_folder_counts(course: Class) -> None:
    course.rules(COURSE + "attempts: {counts: best}\n")
    course.hand_in("ana", "bot")
    roster = "login,handed_in\nana,2026-10-11T10:00Z\n"
    assert course.grade(roster)["ana"].score == 8
    (course.handed / "ana" / "bot" / "package.xml").unlink()
    row = course.grade(roster.replace("10-11", "10-13"))["ana"]
    assert row.score == 8 and lines(row) == [("attempts", 8)]
    assert row.result is not None and row.result.score == 0
    assert [one.handed_in[:10] for one in row.result.attempts] == ["2026-10-11", "2026-10-13"]
    # An attempt is judged again with the others, so it still counts.
    yaml = course.folder / "lesson" / "assignment.yaml"
    yaml.write_text(YAML.replace("points: 6", "points: 7"))
    ledger = Ledger(course.out)
    with ledger.opened():
        again = [one.done for one in regrade_class(load_assignment(yaml.parent), ledger)]
        bring_up_to_date(again, ledger)
    (changed,) = read_class(course.out)
    assert changed.score == 9 and lines(changed) == [("attempts", 9)]
    # What is applied again is the same.
    written = {file: file.stat().st_mtime_ns for file in course.out.rglob(RESULT_FILE)}
    bring_up_to_date([standing(ledger, entry) for entry in ledger.read().entries], ledger)
    assert {file: file.stat().st_mtime_ns for file in course.out.rglob(RESULT_FILE)} == written


def test_a_group_has_what_one_of_them_handed_in(course: Class) -> None:
    course.rules(COURSE + "groups: [[ana, Ben], [cai, dee]]\n")
    course.hand_in("ana", "bot")
    course.hand_in("cai", "bot", "extra")
    course.hand_in("dee", "extra")
    rows = course.grade(
        "login,handed_in,email\nana,2026-10-13T10:00Z,ana@x.edu\nben,,ben@x.edu\n"
        "cai,,\ndee,,\neva,,\n"
    )
    assert {key: row.score for key, row in rows.items()} == {
        "ana": 7,
        "ben": 7,
        "cai": 10,
        "dee": 2,
        "eva": None,
    }
    assert rows["ben"].note == rows["ana"].note == ""
    assert lines(rows["ben"]) == lines(rows["ana"]) == [("late", -1)] and rows["ben"].late
    assert rows["dee"].note == "cai and dee of one group handed in different files"
    (ben,) = (one for one in Ledger(course.out).read().entries if one.key == "ben")
    assert (ben.team, ben.email) == ("ana", "ben@x.edu")


def test_students_that_only_the_rules_know_are_named(course: Class) -> None:
    course.rules(COURSE + "extensions: [{student: anna, assignment: lesson, days: 1}]\n")
    course.hand_in("ana", "bot")
    rules = course_of(course.out, course.folder / "course.yaml", "lesson")
    assert rules is not None
    (line,) = unknown_students(collect(course.handed, course.folder), rules)
    assert line.endswith("an extension names 'anna', not in this class. Did you mean 'ana'?")


def test_hidden_checks_are_in_the_students_report_when_the_rules_release_them(
    course: Class,
) -> None:
    course.hand_in("ana", "bot")
    course.grade(now=NOW)
    copy = Ledger(course.out).folder("ana") / STUDENT_FILE
    assert copy.is_file()
    (course.handed / "ana" / "notes.txt").write_text("again")
    course.grade(now=NOW.replace(day=13))
    assert not copy.exists()


def test_of_an_attempt_that_counts_a_student_sees_only_the_points_of_visible_checks(
    course: Class,
) -> None:
    course.rules(COURSE + "attempts: {counts: best}\n")
    course.hand_in("ana", "bot")
    course.grade()
    shutil.rmtree(course.handed / "ana" / "bot")
    course.hand_in("ana", "extra")
    row = course.grade()["ana"]
    assert lines(row) == [("attempts", 6)] and row.result is not None
    copy = for_student(row.result)
    assert (copy.score, copy.final_score, copy.max_score) == (2, 6, 8)
    assert copy.adjustments[0].reason == ""


def test_a_late_token_moves_the_due_time_and_costs_nothing(course: Class) -> None:
    course.rules(
        f"{COURSE}tokens: {{each: 2, worth: day}}\n"
        "extensions: [{student: ana, assignment: lesson, tokens: 1}]\n"
    )
    course.hand_in("ana", "bot")
    course.hand_in("ben", "bot", text="ben")
    rows = course.grade("login,handed_in\nana,2026-10-13T12:00Z\nben,2026-10-13T12:00Z\n")
    assert (lines(rows["ana"]), lines(rows["ben"])) == ([], [("late", -1)])


@pytest.mark.parametrize(
    "name", ["ana_9999-12-31T23-59-59Z", "ana_0001-01-01T00-00-00+23:59", "ana_2026-02-30T10-00"]
)
def test_a_time_that_cannot_be_is_no_time(course: Class, name: str) -> None:
    course.hand_in(name, "bot")
    (row,) = course.grade().values()
    assert (lines(row), row.score) == ([], 8)


def test_named_rules_that_are_not_there_say_only_that(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"nowhere.yaml: No such file or directory$"):
        course_of(tmp_path / "out", tmp_path / "nowhere.yaml", "lesson")


def test_rules_that_are_gone_are_one_message_and_change_nothing(course: Class) -> None:
    course.hand_in("ana", "bot")
    course.grade()
    before = (course.out / "grades.csv").read_text()
    (course.folder / "course.yaml").rename(course.folder / "elsewhere.yaml")
    with pytest.raises(UsageError, match=r"course.yaml: does not exist, and the rules of"):
        read_class(course.out)
    assert (course.out / "grades.csv").read_text() == before


def test_groups_that_are_written_down_later_are_applied_by_a_report(course: Class) -> None:
    course.hand_in("ben", "bot", "extra")
    roster = "login,name\nana,Ana\nben,Ben\ncai,Cai\n"
    assert course.grade(roster)["ana"].missing
    course.rules(COURSE + "groups: [[ana, ben]]\n")
    for _ in range(2):
        rows = course.reported()
        assert (rows["ana"].score, rows["ana"].note) == (rows["ben"].score, "") != (None, "")
    assert {course.entries()[key].review_key for key in ("ana", "ben")} == {"ben"}
    assert course.grade(roster)["ana"].score == rows["ben"].score
    course.rules(COURSE + "groups: [[ben, cai]]\n")
    rows = course.reported()
    assert rows["ana"].missing and rows["cai"].score == rows["ben"].score
    assert Ledger(course.out).read().entries[1].review_key == "ben"


ROSTER = "login\nana\nben\ncai\nzed\n"


@pytest.mark.parametrize("roster", [ROSTER, ""])
def test_who_handed_in_the_same_keeps_the_grade_when_the_other_hands_in_again(
    course: Class, roster: str
) -> None:
    for name in ("ben", "cai", "zed"):
        course.hand_in(name, "bot", "extra")
    course.grade(roster)
    assert course.entries()["zed"].same_as == "ben"
    rows = course.grade(roster, handed=course.hand_in("wed/ben", "extra").parent)
    assert {key: rows[key].score for key in ("ben", "cai", "zed")} == {
        "ben": 2,
        "cai": 10,
        "zed": 10,
    }
    assert [course.entries()[key].same_as for key in ("cai", "zed")] == ["", "cai"]
    assert rows["zed"].note == "the same submission as cai"
    rows = course.grade(roster, handed=course.hand_in("thu/ana", "bot").parent)
    assert [rows[key].score for key in ("ana", "ben", "cai", "zed")] == [8, 2, 10, 10]


def test_of_two_who_are_kept_with_the_same_submission_each_still_names_the_other(
    course: Class,
) -> None:
    for name in ("ben", "zed"):
        course.hand_in(name, "bot")
    course.grade(ROSTER)
    rows = course.grade(ROSTER, handed=course.hand_in("wed/ana", "extra").parent)
    assert rows["zed"].note == "the same submission as ben" and rows["zed"].score == 8
    assert rows["ben"].note == "the same submission as zed"


def test_a_group_keeps_its_grade_when_others_hand_in(course: Class) -> None:
    course.rules(COURSE + "groups: [[ana, ben]]\n")
    course.hand_in("ben", "bot", text="mon")
    course.hand_in("zed", "extra")
    course.grade(ROSTER)
    for handed in ("wed/zed", "thu/zed"):
        rows = course.grade(ROSTER, handed=course.hand_in(handed, "bot").parent)
        assert {key: (rows[key].score, rows[key].note) for key in ("ana", "ben", "zed")} == (
            dict.fromkeys(("ana", "ben", "zed"), (8, ""))
        )
    # With another submission of one of them, both have that.
    rows = course.grade(ROSTER, handed=course.hand_in("fri/ben", "extra").parent)
    assert [rows[key].score for key in ("ana", "ben", "zed")] == [2, 2, 8]


def test_what_an_interrupted_batch_left_is_graded_by_the_next_from_where_it_lay(
    course: Class,
) -> None:
    for name, text in (("ana", "a"), ("ben", "b"), ("cai", "c"), ("zed", "b")):
        course.hand_in(name, "bot", text=text)
    with Ledger(course.out).opened() as ledger:
        batch = Batch(course.loaded, ledger)
        _, to_do = batch.read(collect(course.handed, course.folder))
        assert list(to_do) == ["ana", "ben", "cai"]
    # What was changed meanwhile is not what she handed in.
    (course.handed / "ana" / "notes.txt").write_text("changed")
    rows = course.grade(ROSTER, handed=course.hand_in("wed/cai", "extra").parent)
    assert {key: row.score for key, row in rows.items()} == {
        "ana": None,
        "ben": 8,
        "cai": 2,
        "zed": 8,
    }
    assert "not graded yet" in rows["ana"].note


@pytest.mark.parametrize("reviewed", [(), ("ben",), ("abe",), ("ben", "abe")])
def test_a_group_takes_no_review_from_anybody(course: Class, reviewed: tuple[str, ...]) -> None:
    roster = "login\nana\nabe\nben\n"
    course.hand_in("ben", "bot")
    course.grade(roster)
    store, keys = ReviewStore(course.out), {key: key for key in reviewed}
    for key in reviewed:
        given = Given(points=1, reason=f"Talk of {key}.", by="AB")
        store.save(StudentReview(key=key, given=(given,)), "")

    def shown() -> dict[str, str]:
        return {key: course.entries()[key].review_key for key in ("abe", "ben")}

    course.rules(COURSE + "groups: [[abe, ben]]\n")
    # Without a review it is that of the one who handed in, though another row comes first.
    expected = {key: keys.get(key, (*reviewed, "ben")[0]) for key in ("abe", "ben")}
    assert course.reported()["abe"].score == (9 if reviewed else 8)
    assert shown() == expected
    # A batch picks it in the same way as a report, and so it stays.
    course.grade(roster)
    assert shown() == expected
    course.hand_in("ana", "extra")
    assert course.grade(roster)["ben"].score == (9 if reviewed else 8)
    course.reported()
    assert shown() == expected


def test_a_group_is_not_graded_with_two_versions_of_the_assignment(course: Class) -> None:
    course.hand_in("ben", "bot")
    course.grade(ROSTER)
    yaml = course.folder / "lesson" / "assignment.yaml"
    yaml.write_text(YAML.replace("points: 6", "points: 7"))
    course.rules(COURSE + "groups: [[ana, ben]]\n")
    with pytest.raises(UsageError, match=r"changed since this was graded.*rosgrade regrade .*out "):
        course.reported()
    rows = {row.id: row for row in read_class(course.out)}
    assert rows["ben"].score == 8 and rows["ana"].missing
    assert not Ledger(course.out).folder("ana").exists()
    ledger = Ledger(course.out)
    with ledger.opened():
        list(regrade_class(load_assignment(yaml.parent), ledger))
    rows = course.reported()
    assert rows["ana"].score == rows["ben"].score == 9
