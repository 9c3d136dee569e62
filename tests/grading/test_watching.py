"""Watching real files; what grades them is played, so that it takes as long as a test wants."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from grader.errors import GraderFault, UsageError
from grader.grading.graded import Graded
from grader.grading.watching import Ended, Step, Watching
from grader.submission.prepare import Prepared, fingerprint
from tests.grade.sample import make_submission
from tests.report.sample import full_points


class Played:
    """Grades when the test lets it."""

    def __init__(self, submission: Path) -> None:
        self.submission = submission
        self.let_go = threading.Event()
        self.begun = threading.Event()
        self.error: BaseException | None = None
        self.grades = 0
        self.let_go.set()

    def begin(self) -> None:
        self.cancelled = threading.Event()

    def grade(self) -> Graded:
        self.grades += 1
        sha256 = fingerprint(self.submission)
        self.begun.set()
        while not self.let_go.wait(0.01):
            if self.cancelled.is_set():
                raise GraderFault("interrupted")
        if self.error is not None:
            raise self.error
        record = make_submission(sha256=sha256)
        return Graded(full_points().grade, Prepared(record, None), {}, {}, {}, {})

    def cancel(self) -> None:
        self.cancelled.set()


@pytest.fixture
def watched(tmp_path: Path) -> Iterator[SimpleNamespace]:
    submission = tmp_path / "ws"
    file = submission / "bot" / "node.py"
    file.parent.mkdir(parents=True)
    (submission / "bot" / "package.xml").write_text("<package/>")
    file.write_text("one")
    played = Played(submission)
    (tmp_path / "lesson").mkdir()
    report = submission / "rosgrade-report"
    events = Watching(submission, report, played, tmp_path / "lesson").events()
    yield SimpleNamespace(submission=submission, file=file, played=played, events=events)
    events.close()
    assert not [thread for thread in threading.enumerate() if thread.name in ("watch", "grade")]


def test_a_saved_file_is_graded_again(watched: SimpleNamespace) -> None:
    assert next(watched.events) is Step.BEGAN
    assert isinstance(next(watched.events), Ended)
    watched.file.write_text("two")
    assert next(watched.events) is Step.BEGAN
    assert isinstance(next(watched.events), Ended)
    assert watched.played.grades == 2


def test_a_folder_that_is_replaced_is_watched_on(watched: SimpleNamespace) -> None:
    next(watched.events), next(watched.events)
    # As `git clone` or an unpacked archive puts another folder in the place of the first.
    fresh = watched.submission.with_name("fresh")
    shutil.copytree(watched.submission, fresh)
    (fresh / "bot" / "node.py").write_text("two")
    watched.submission.rename(watched.submission.with_name("old"))
    fresh.rename(watched.submission)
    assert next(watched.events) is Step.BEGAN
    assert isinstance(next(watched.events), Ended)
    watched.file.write_text("three")
    assert next(watched.events) is Step.BEGAN
    assert isinstance(next(watched.events), Ended)


def test_what_is_no_work_is_not_graded(watched: SimpleNamespace) -> None:
    next(watched.events), next(watched.events)
    for place in (
        "build/bot/x.py",
        "install/x",
        "log/x",
        ".git/index",
        "bot/__pycache__/x.pyc",
        "rosgrade-report/result.json",
    ):
        path = watched.submission / place
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("x")
    # The same text again is no change either.
    watched.file.write_text("one")
    saved = threading.Timer(0.5, lambda: watched.file.write_text("two"))
    saved.start()
    assert next(watched.events) is Step.BEGAN
    assert watched.file.read_text() == "two"
    saved.join()


def test_what_an_editor_keeps_beside_a_file_is_no_change(watched: SimpleNamespace) -> None:
    next(watched.events), next(watched.events)
    watched.file.with_name(".node.py.swp").write_text("x")
    watched.file.with_name("node.py~").write_text("x")
    saved = threading.Timer(0.5, lambda: watched.file.write_text("two"))
    saved.start()
    assert next(watched.events) is Step.BEGAN
    assert watched.file.read_text() == "two"
    saved.join()


def test_a_save_as_editors_do_it_is_noticed(watched: SimpleNamespace) -> None:
    next(watched.events), next(watched.events)
    draft = watched.file.with_name("4913")
    draft.write_text("two")
    draft.replace(watched.file)
    assert next(watched.events) is Step.BEGAN
    assert isinstance(next(watched.events), Ended)


def test_a_save_during_a_run_ends_it_and_begins_anew(watched: SimpleNamespace) -> None:
    played = watched.played
    played.let_go.clear()

    def save() -> None:
        played.begun.wait()
        watched.file.write_text("two")

    saving = threading.Thread(target=save)
    saving.start()
    assert next(watched.events) is Step.BEGAN
    assert next(watched.events) is Step.CANCELLED
    saving.join()
    played.let_go.set()
    assert next(watched.events) is Step.BEGAN
    assert isinstance(next(watched.events), Ended)
    assert played.grades == 2


def test_the_end_ends_what_runs(watched: SimpleNamespace) -> None:
    watched.played.let_go.clear()
    assert next(watched.events) is Step.BEGAN
    ended = threading.Thread(
        target=lambda: (watched.played.begun.wait(), watched.file.write_text("x"))
    )
    ended.start()
    assert next(watched.events) is Step.CANCELLED
    assert next(watched.events) is Step.BEGAN
    ended.join()
    watched.events.close()
    assert watched.played.cancelled.is_set()


def test_an_error_is_reported_and_watching_goes_on(watched: SimpleNamespace) -> None:
    watched.played.error = UsageError("no such thing")
    next(watched.events)
    event = next(watched.events)
    assert isinstance(event, Ended) and str(event.problem) == "no such thing"
    watched.played.error = None
    watched.file.write_text("two")
    assert next(watched.events) is Step.BEGAN
    assert next(watched.events).problem is None


def test_a_bug_is_not_hidden(watched: SimpleNamespace) -> None:
    watched.played.error = ZeroDivisionError("a bug")
    next(watched.events)
    with pytest.raises(ZeroDivisionError, match="a bug"):
        next(watched.events)


def test_a_saved_file_of_the_assignment_is_graded_with(tmp_path: Path) -> None:
    submission = tmp_path / "ws"
    submission.mkdir()
    (submission / "package.xml").write_text("<package/>")
    assignment = tmp_path / "mine"
    assignment.mkdir()
    file = assignment / "assignment.yaml"
    file.write_text("one")
    played = Played(submission)
    # The author works in the assignment's own folder, and so the report lies in it.
    report = assignment / "rosgrade-report"
    events = Watching(submission, report, played, assignment).events()
    next(events), next(events)
    report.mkdir()
    (report / "report.html").write_text("x")
    (assignment / "__pycache__").mkdir()
    (assignment / "__pycache__" / "checks.pyc").write_text("x")
    saved = threading.Timer(0.5, lambda: file.write_text("two"))
    saved.start()
    assert next(events) is Step.BEGAN
    assert file.read_text() == "two"
    assert isinstance(next(events), Ended)
    assert played.grades == 2
    saved.join()
    events.close()


def test_an_archive_that_is_replaced_is_graded_again(tmp_path: Path) -> None:
    import zipfile

    archive = tmp_path / "ada.zip"

    def write(text: str) -> None:
        with zipfile.ZipFile(archive.with_suffix(".new"), "w") as file:
            file.writestr("bot/node.py", text)
        archive.with_suffix(".new").replace(archive)

    write("one")
    (tmp_path / "lesson").mkdir()
    report = tmp_path / "rosgrade-report"
    events = Watching(archive, report, Played(archive), tmp_path / "lesson").events()
    next(events), next(events)
    (tmp_path / "notes.txt").write_text("x")
    write("two")
    assert next(events) is Step.BEGAN
    events.close()
