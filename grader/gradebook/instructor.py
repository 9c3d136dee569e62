"""The pages of a class that only its instructor sees, in ``OUT/instructor/``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from grader.assignment.load import LoadedAssignment
from grader.assignment.reference import CPP, LANGUAGES, reference_of
from grader.authoring.starter import starter_files
from grader.batch.ledger import Entry, Ledger
from grader.errors import RosgradeError, UsageError
from grader.gradebook import similarity
from grader.gradebook.adjusting import ClassAdjustments
from grader.gradebook.class_files import INSTRUCTOR_FOLDER, all_standing, write_class
from grader.gradebook.questions import Work, ask
from grader.grading.graded import RECORDINGS_FOLDER
from grader.recording.mcap_reader import read_recording
from grader.report.files import write_whole
from grader.report.html.page import render_page
from grader.submission.kept_source import SOURCE_FOLDER, read_kept_source


def write_similarity(loaded: LoadedAssignment, ledger: Ledger) -> tuple[Path, int]:
    """Write the page of the submissions that are alike: its file, and how many pairs there are."""
    same: dict[str, list[Entry]] = {}
    for entry in _entries(ledger):
        same.setdefault(entry.original, []).append(entry)
    names = {
        key: ", ".join(entry.name or entry.key for entry in entries)
        for key, entries in same.items()
    }
    teams = {key: entries[0].team for key, entries in same.items() if entries[0].team}
    given_to_all = _given_to_all(loaded)
    hashes: dict[str, set[int]] = {}
    for key in same:
        prints = similarity.fingerprints(_files(ledger, key))
        if prints:
            hashes[key] = prints.keys() - given_to_all
    pairs = similarity.find_pairs(hashes, teams)
    on_page = {key for pair in pairs[: similarity.MOST_PAIRS] for key in (pair.first, pair.second)}
    page = similarity.render_similarity(
        loaded.assignment.title,
        pairs,
        {key: _files(ledger, key) for key in on_page},
        {key: names[key] for key in hashes},
        [name for key, name in names.items() if key not in hashes],
    )
    return _write_page(ledger, "similarity.html", page), len(pairs)


def write_questions(
    loaded: LoadedAssignment, ledger: Ledger, on_read: Callable[[str], None] = lambda _: None
) -> tuple[Path, int]:
    """Write the page of questions for oral exams: its file, and for how many submissions."""
    entries = _entries(ledger)
    lines: Counter[str] = Counter()
    for entry in entries:
        texts = _files(ledger, entry.key).values()
        lines.update({line.strip() for text in texts for line in text.split("\n")})
    usual = frozenset(line for line, times in lines.items() if times > len(entries) / 3)
    students = []
    for entry in entries:
        recordings = []
        for file in sorted((ledger.folder(entry.key) / RECORDINGS_FOLDER).glob("*.mcap")):
            # A damaged one is reported where it is judged.
            with suppress(RosgradeError):
                recordings.append(read_recording(file))
        questions = ask(Work(recordings, _files(ledger, entry.key), usual))
        students.append((entry.name or entry.key, questions))
        on_read(entry.key)
    page = render_page(
        "questions.html.j2",
        ("report.css", "instructor.css"),
        title=loaded.assignment.title,
        students=students,
    )
    return _write_page(ledger, "questions.html", page), len(students)


def _entries(ledger: Ledger) -> list[Entry]:
    """Rows with a submission, without earlier attempts."""
    return [entry for entry in ledger.read().entries if entry.sha256 and not entry.attempt_of]


def _files(ledger: Ledger, key: str) -> dict[str, str]:
    return read_kept_source(ledger.folder(key) / SOURCE_FOLDER).files


def _given_to_all(loaded: LoadedAssignment) -> set[int]:
    """Hashes of what does not count: the starter and the reference, in both languages."""
    hashes: set[int] = set()
    for language in LANGUAGES:
        # An assignment may be for Python only, or have no reference.
        with suppress(UsageError):
            hashes |= similarity.all_hashes(starter_files(loaded, cpp=language is CPP))
        with suppress(UsageError):
            reference = reference_of(loaded.assignment.id, loaded.folder, language)
            hashes |= similarity.all_hashes(read_kept_source(reference).files)
    return hashes


def _write_page(ledger: Ledger, name: str, page: str) -> Path:
    file = ledger.out / INSTRUCTOR_FOLDER / name
    write_whole(file, page)
    adjust = ClassAdjustments(ledger)
    write_class([adjust.row(row) for row in all_standing(ledger)], ledger)
    return file
