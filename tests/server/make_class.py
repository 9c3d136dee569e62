"""A small class in a folder, as a batch leaves it: judged by its source, one row empty."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from pathlib import Path

from grader.assignment.load import LoadedAssignment, load_assignment
from grader.batch.ledger import Entry, Ledger
from grader.errors import UsageError
from grader.grade import judge_all
from grader.gradebook.class_files import standing, write_class
from grader.grading.files import write_graded
from grader.grading.graded import RECORDINGS_FOLDER, SUBMISSION_FILE, Graded
from grader.recording.model import to_json
from grader.recording.submission import PackageRecord, SourceFile, SourceFunction, SubmissionRecord
from grader.report.model.facts import Clock
from grader.submission.kept_source import SOURCE_FOLDER
from grader.submission.prepare import Prepared

YAML = """\
rosgrade: 1
id: lesson
title: A lesson
packages: [{name: bot}]
checks:
  - {id: package, uses: package.found, with: {package: bot}, points: 1}
  # Every function must have one.
  - id: docs
    uses: source.docstrings
    with: {package: bot, of: [function]}
    points: 4
    requires: [package]

  - {id: print, uses: source.no_print, with: {package: bot}, points: 1}
manual:
  - id: readme
    title: The README says how to run it
    points: 2
    levels: [{title: missing, points: 0}, {title: there, points: 1}, {title: complete, points: 2}]
  - {id: oral, title: Oral answers, points: 5}
"""
NODE = "bot/node.py"
CODE = '''\
def spin():
    """Spin."""
    print("\u202espin")


def stop():
    return "<b>\x1b[31m</b>"
'''
STUDENTS = {"ana": 2, "ben": 1, "cai": 1, 'd "<b>eli</b>': 1}
"""Key -> how many of its two functions have a docstring."""


def record(key: str, documented: int) -> SubmissionRecord:
    """A submission as it would be read."""
    functions = (SourceFunction("spin", 1, True), SourceFunction("stop", 6, documented == 2))
    source = SourceFile(
        NODE, "bot.node", True, functions=functions, prints=(3,) * (documented == 1)
    )
    package = PackageRecord("bot", "bot", sources=(source,))
    return SubmissionRecord(key, key, packages=(package,))


def make_class(folder: Path) -> Path:
    """Write a class and its assignment into a folder, and return the folder of the class."""
    lesson = folder / "lesson"
    lesson.mkdir()
    (lesson / "assignment.yaml").write_text(YAML, encoding="utf-8")
    loaded = load_assignment(lesson)
    entries = [*(Entry(key, sha256=key) for key in STUDENTS), Entry("eve")]
    with Ledger(folder / "out").opened() as ledger:
        for key, documented in STUDENTS.items():
            put(ledger, loaded, record(key, documented))
        ledger.write(entries, "lesson", loaded.sha256, loaded.location)
        write_class([standing(ledger, entry) for entry in entries], ledger)
    return folder / "out"


@contextmanager
def writing(out: Path) -> Iterator[Ledger]:
    """Hold the folder of a class as a batch does, when the pages have written their changes."""
    with ExitStack() as stack:
        held = None
        while held is None:
            with suppress(UsageError):
                held = stack.enter_context(Ledger(out).opened())
        yield held


def hand_in_again(out: Path, key: str, documented: int) -> str:
    """Grade another attempt of a student, as a batch does; returns the key of the one before."""
    loaded = load_assignment(out.parent / "lesson")
    with writing(out) as ledger:
        entries = {one.key: one for one in ledger.read().entries}
        before = f"{key} (attempt 1)"
        kept = replace(entries[key], key=before, attempt_of=key)
        again = replace(entries[key], sha256=f"again-{key}")
        submission = replace(record(key, documented), sha256=again.sha256)
        put(ledger, loaded, replace(record(key, STUDENTS[key]), id=before))
        put(ledger, loaded, submission)
        rows = [*(entries | {key: again}).values(), kept]
        ledger.write(rows, "lesson", loaded.sha256, loaded.location)
    return before


def put(ledger: Ledger, loaded: LoadedAssignment, submission: SubmissionRecord) -> None:
    """Judge a submission, and write it as a batch does."""
    partial = ledger.partial(submission.id)
    for file, text in ((NODE, CODE), ("README.md", "# Run it\n")):
        kept = partial / SOURCE_FOLDER / file
        kept.parent.mkdir(parents=True, exist_ok=True)
        kept.write_text(text, encoding="utf-8")
    (partial / RECORDINGS_FOLDER).mkdir()
    (partial / RECORDINGS_FOLDER / SUBMISSION_FILE).write_bytes(to_json(submission))
    prepared = Prepared(submission, None)
    judged = Graded(judge_all(loaded, submission, {}), prepared, {}, {}, {}, {})
    write_graded(judged, partial, Clock())
    ledger.put(submission.id, partial)
