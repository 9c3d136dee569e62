"""`rosgrade regrade`, `report` and `export` on a class that was graded: all of it stays one."""

from __future__ import annotations

import csv
import dataclasses
import io
import shutil
from pathlib import Path

import pytest

from grader.assignment.load import LoadedAssignment, load_assignment
from grader.batch.ledger import Entry, Ledger
from grader.grade import judge_all
from grader.gradebook.class_files import standing, write_class
from grader.grading.files import write_graded
from grader.grading.graded import RECORDINGS_FOLDER, SUBMISSION_FILE, Graded
from grader.recording.mcap_writer import write_recording
from grader.recording.model import to_json
from grader.recording.submission import SubmissionRecord
from grader.report.model.cluster import cause
from grader.report.model.facts import Clock
from grader.report.model.result import read_result
from grader.review.model import ClassReview, Comment, Forgiven, ManualScore, StudentReview
from grader.review.store import ReviewStore
from grader.submission.prepare import Prepared
from tests.cli.conftest import ROOT, Rosgrade
from tests.grading.test_grading import recording

YAML = """\
rosgrade: 1
id: lesson
title: Test
packages: [{name: bot, executables: [bot]}]
scenarios:
  - {id: run, launch: [{executable: bot}], timeout: 5 s}
checks:
  - {id: package, uses: package.found, with: {package: bot}, points: 1}
  - {id: other, uses: package.found, with: {package: bot}, points: 1}
"""
BROKEN = "zed.zip: is broken"


def graded(loaded: LoadedAssignment, name: str, sha256: str, problem: str | None) -> Graded:
    """A submission without any package, judged."""
    record = SubmissionRecord(name, sha256, problem)
    return Graded(judge_all(loaded, record, {}), Prepared(record, None), {}, {}, {}, {})


@pytest.fixture
def lesson(tmp_path: Path) -> Path:
    folder = tmp_path / "my lessons" / "lesson"
    folder.mkdir(parents=True)
    (folder / "assignment.yaml").write_text(YAML, encoding="utf-8")
    return folder


@pytest.fixture
def out(tmp_path: Path, lesson: Path) -> Path:
    """A class: ana and cai handed in the same, zed an archive that is broken, eve nothing."""
    loaded = load_assignment(lesson)
    rows = [
        Entry("ana", "Ana", sha256="a"),
        Entry("ben", "Ben", late=True, sha256="b"),
        Entry("cai", same_as="ana", sha256="a"),
        Entry("eve", problem="handed in nothing"),
        Entry("zed", sha256="z"),
    ]
    with Ledger(tmp_path / "out").opened() as ledger:
        for row in rows:
            if row.sha256:
                problem = BROKEN if row.key == "zed" else None
                result = graded(loaded, row.key, row.sha256, problem)
                partial = ledger.partial(row.key)
                (partial / RECORDINGS_FOLDER).mkdir()
                facts = partial / RECORDINGS_FOLDER / SUBMISSION_FILE
                facts.write_bytes(to_json(result.prepared.record))
                write_graded(result, partial, Clock())
                ledger.put(row.key, partial)
        ledger.write(rows, "lesson", loaded.sha256, loaded.location)
        write_class([standing(ledger, row) for row in rows], ledger)
    return tmp_path / "out"


def grades(text: str) -> dict[str, dict[str, str]]:
    return {row["submission"]: row for row in csv.DictReader(io.StringIO(text))}


def with_more_points(lesson: Path) -> None:
    file = lesson / "assignment.yaml"
    file.write_text(YAML.replace("points: 1", "points: 2"), encoding="utf-8")


@pytest.mark.parametrize("part", [".", "submissions/ana", "submissions/ana/recordings"])
def test_a_class_is_regraded_as_a_whole_also_if_one_submission_is_named(
    rosgrade: Rosgrade, out: Path, lesson: Path, part: str
) -> None:
    with_more_points(lesson)
    ended = rosgrade("regrade", out / part)
    # One of them cannot be read.
    assert ended.returncode == 3, ended.stderr
    assert f"Assignment: {lesson}/assignment.yaml" in ended.stdout
    found = grades((out / "grades.csv").read_text())
    assert [found[key]["max_score"] for key in ("ana", "ben", "cai")] == ["4", "4", "4"]
    assert list((out / "submissions" / "cai" / "earlier").glob("result-*.json"))
    assert "/ 4" in (out / "index.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("part", [".", "submissions/ana"])
def test_a_dry_run_says_who_gains_what_and_writes_nothing(
    rosgrade: Rosgrade, out: Path, lesson: Path, part: str
) -> None:
    with_more_points(lesson)
    before = {file: file.read_bytes() for file in out.rglob("*.*") if file.is_file()}
    ended = rosgrade("regrade", out / part, "--dry-run")
    assert "Nothing was written (--dry-run)." in ended.stdout
    assert {file: file.read_bytes() for file in out.rglob("*.*") if file.is_file()} == before


def test_what_report_recommends_names_the_assignment_and_works(
    rosgrade: Rosgrade, out: Path, lesson: Path
) -> None:
    folder = out / "submissions" / "ben"
    assert rosgrade("report", folder).returncode == 0
    with_more_points(lesson)
    ended = rosgrade("report", folder)
    assert ended.returncode == 2
    assert f"`rosgrade regrade {folder} '{lesson}'` judges again" in ended.stderr


@pytest.mark.parametrize("command", ["regrade", "report"])
def test_an_assignment_that_is_not_where_it_was_is_asked_for(
    rosgrade: Rosgrade, out: Path, lesson: Path, command: str
) -> None:
    moved = lesson.parent.parent / "lesson"
    shutil.move(lesson, moved)
    for path in (out, out / "submissions" / "ana"):
        ended = rosgrade(command, path)
        assert ended.returncode == 2
        assert (
            f"was graded with the assignment 'lesson' in {lesson}, which does not exist any more"
            in (ended.stderr)
        )
        named = out if command == "regrade" else path
        assert f"name its folder: `rosgrade {command} {named} FOLDER`" in ended.stderr or (
            path == out and "FOLDER`" in ended.stderr
        )
    for path in (out / "submissions" / "ana", out):
        assert rosgrade(command, path, moved).returncode in (0, 1, 3)


def test_an_own_assignment_of_an_older_result_is_asked_for(
    rosgrade: Rosgrade, out: Path, lesson: Path
) -> None:
    file = out / "batch.json"
    file.write_text(file.read_text().replace(f'"location": "{lesson}"', '"more": 0'))
    ended = rosgrade("regrade", out)
    assert ended.returncode == 2
    assert f"{out}: was graded with the assignment 'lesson'; name its folder: " in ended.stderr
    assert rosgrade("regrade", out, lesson).returncode == 3
    assert rosgrade("regrade", out).returncode == 3


def test_the_export_of_a_class_is_its_gradebook(rosgrade: Rosgrade, out: Path) -> None:
    written = out.parent / "export.csv"
    assert rosgrade("export", "csv", out, "-o", written).returncode == 0
    assert written.read_bytes() == (out / "grades.csv").read_bytes()
    found = grades(written.read_text())
    assert {key: (row["status"], row["score"]) for key, row in found.items()} == {
        "ana": ("graded", "0"),
        "ben": ("graded", "0"),
        "cai": ("graded", "0"),
        "eve": ("missing", ""),
        "zed": ("unreadable", ""),
    }
    assert (found["ben"]["name"], found["ben"]["late"]) == ("Ben", "yes")
    assert found["eve"]["note"] == "handed in nothing" and found["zed"]["note"] == BROKEN


def test_no_export_overwrites_what_it_reads(rosgrade: Rosgrade, out: Path, lesson: Path) -> None:
    gradebook = out.parent / "canvas.csv"
    gradebook.write_text("Student,ID,Section\nAna,ana,1\n")
    result = out / "submissions" / "ana" / "result.json"
    before = [file.read_bytes() for file in (gradebook, result)]
    for arguments in (
        ("canvas", out, "--canvas", gradebook),
        ("canvas", out, "--canvas", gradebook, "-o", gradebook.parent / "." / "canvas.csv"),
        ("canvas", out, "--canvas", gradebook, "-o", result),
        ("csv", out, "-o", result),
        ("csv", out, "-o", out / "batch.json"),
        ("gradescope", lesson, "--out", lesson),
        ("classroom50", lesson, "--out", lesson / "more"),
        ("github", lesson, "--action", "./x", "--out", lesson),
    ):
        ended = rosgrade("export", *arguments)
        assert ended.returncode == 2, arguments
        assert "this command reads" in ended.stderr or "lies in" in ended.stderr
    assert [file.read_bytes() for file in (gradebook, result)] == before
    assert sorted(item.name for item in lesson.iterdir()) == ["assignment.yaml"]


def test_no_other_command_overwrites_what_it_reads(
    rosgrade: Rosgrade, out: Path, lesson: Path
) -> None:
    folder = out.parent / "class" / "ana"
    folder.mkdir(parents=True)
    (folder / "package.xml").write_text("<package/>")
    roster = out.parent / "roster.csv"
    roster.write_text("login,submission\nana,class/ana\n")
    one, yaml = out / "submissions" / "ana", lesson / "assignment.yaml"
    before = {file: file.read_bytes() for file in (folder / "package.xml", roster, yaml)}
    for arguments in (
        ("check", lesson, folder, "--report", folder),
        ("check", lesson, folder, "--json", folder / "package.xml"),
        ("check", lesson, folder, "--junit", yaml),
        ("check", lesson, folder, "--gradescope", "a.json", "--markdown", "./a.json"),
        ("check", lesson, folder, "--gradescope", "m", "--gradescope-metadata", "m"),
        ("watch", lesson, folder, "--report", folder),
        ("selftest", "qos", "--keep", ROOT / "reference" / "qos" / "kept"),
        ("batch", lesson, folder.parent, "--out", folder.parent),
        ("batch", lesson, folder.parent, "--out", folder / "results"),
        ("batch", lesson, folder.parent, "--out", lesson / "results"),
        ("batch", lesson, folder.parent, "--out", roster, "--roster", roster),
        ("batch", lesson, roster, "--out", folder / "results"),
        ("report", one, "--junit", one / "result.json"),
        ("report", one, "--markdown", one / "recordings" / "submission.json"),
        ("show", lesson, "--html", "--out", yaml),
    ):
        ended = rosgrade(*arguments, *(["--sandbox", "none"] * (arguments[0] == "batch")))
        assert ended.returncode == 2, (arguments, ended.stderr)
        assert any(
            said in ended.stderr
            for said in ("this command reads", "lies in", "given for two outputs")
        ), (arguments, ended.stderr)
    assert {file: file.read_bytes() for file in before} == before
    assert [item.name for item in folder.iterdir()] == ["package.xml"]


@pytest.mark.parametrize(
    ("kept", "options"), [("recordings/my.mcap", ()), ("install/a", ("--keep",))]
)
def test_a_report_replaces_no_recordings_or_install_space_of_others(
    rosgrade: Rosgrade, tmp_path: Path, lesson: Path, kept: str, options: tuple[str, ...]
) -> None:
    mine = tmp_path / "mine" / kept
    mine.parent.mkdir(parents=True)
    mine.write_text("mine")
    (tmp_path / "work").mkdir()
    arguments = ("check", lesson, tmp_path / "work", "--report", tmp_path / "mine", *options)
    ended = rosgrade(*arguments, "--sandbox", "none")
    assert ended.returncode == 2
    assert "does not belong to a report, so it stays" in ended.stderr
    assert mine.read_text() == "mine"


def test_one_recording_is_judged_and_replayed_with_the_assignment_it_was_made_for(
    rosgrade: Rosgrade, tmp_path: Path
) -> None:
    file = tmp_path / "run.mcap"
    made = dataclasses.replace(recording(), environment={"assignment": "my_lesson"})
    write_recording(file, made, (), {})
    for command, more in (("regrade", ()), ("replay", (tmp_path,))):
        ended = rosgrade(command, file, *more)
        assert ended.returncode == 2
        words = " ".join(map(str, (command, file, *more)))
        assert (
            f"{file}: was graded with the assignment 'my_lesson'; name its folder: " in ended.stderr
        )
        assert f"`rosgrade {words} FOLDER`" in ended.stderr


MANUAL = "manual:\n  - {id: readme, title: README, points: 2}\n"


def test_what_a_person_wrote_reaches_every_file_and_survives_a_regrade(
    rosgrade: Rosgrade, out: Path, lesson: Path
) -> None:
    (lesson / "assignment.yaml").write_text(YAML + MANUAL, encoding="utf-8")
    assert rosgrade("regrade", out).returncode == 3
    csv_file = out / "grades.csv"
    assert grades(csv_file.read_text())["ana"]["status"] == "waits for a person"
    store = ReviewStore(out)
    review = StudentReview(
        key="ana",
        manual={"readme": ManualScore(points=1.5, by="AB")},
        comments=(Comment(text="See REP-144", by="AB"),),
    )
    store.save(review, "")
    (check, *_) = read_result(out / "submissions" / "ana" / "result.json").checks
    forgiven = Forgiven(check=check.id, cause=cause(check), by="AB")
    version = store.save(ClassReview(forgiven=(forgiven,)), "")
    for command, status in (("report", 0), ("regrade", 3)):
        assert rosgrade(command, out).returncode == status
        found = grades(csv_file.read_text())
        columns = ("score", "max_score", "readme (2)", "forgiven points")
        assert [found["ana"][one] for one in columns] == ["2.5", "4", "1.5", "1"]
        assert found["cai"]["status"] == "waits for a person"
        page = (out / "submissions" / "ana" / "report.html").read_text(encoding="utf-8")
        assert "README: 1.5 of 2 points, by AB" in page and "See REP-144" in page
    exported = out.parent / "export.csv"
    assert rosgrade("export", "csv", out, "-o", exported).returncode == 0
    assert exported.read_bytes() == csv_file.read_bytes()
    store.undo(None, version)
    assert rosgrade("report", out).returncode == 0
    assert grades(csv_file.read_text())["ana"]["score"] == "1.5"
    assert store.student("ana").content == review


@pytest.mark.parametrize(
    "arguments", [("report",), ("regrade",), ("export", "csv")], ids=lambda words: words[0]
)
def test_a_review_that_is_nonsense_is_one_message_and_stays(
    rosgrade: Rosgrade, out: Path, arguments: tuple[str, ...]
) -> None:
    file = ReviewStore(out).file("ana")
    file.parent.mkdir()
    file.write_text("key: ana\ncomments: [nice]\n", encoding="utf-8")
    page = (out / "submissions" / "ana" / "report.html").read_bytes()
    ended = rosgrade(*arguments, out)
    assert ended.returncode == 2
    assert ended.stderr.count("error: ") == 1 and "Traceback" not in ended.stderr
    assert f"{file}:2: comments[0]: " in ended.stderr
    assert file.read_text(encoding="utf-8") == "key: ana\ncomments: [nice]\n"
    assert (out / "submissions" / "ana" / "report.html").read_bytes() == page
