"""What each student of a class is given: the student's copy of the result and the report."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from grader.batch.class_files import class_rows, standing
from grader.batch.files import REPORT_FILE, STUDENT_FILE
from grader.batch.ledger import Ledger
from grader.batch.roster import Roster, Student, written
from grader.report.files import folder_name, write_whole
from grader.report.formats.markdown import render_markdown
from grader.report.model.class_row import ClassRow, RowStatus
from grader.report.model.result_model import Result
from grader.report.model.student import for_student
from grader.safe_text import one_line

FEEDBACK_FOLDER = "rosgrade-feedback"


@dataclass(frozen=True)
class Feedback:
    """Of one student; ``result`` and ``report`` say nothing of hidden checks."""

    key: str
    name: str
    result: Result
    report: Path
    source: Path


def class_feedback(out: Path) -> tuple[list[Feedback], list[str]]:
    """The feedback for each student of a batch, and who cannot get any, with why."""
    ledger = Ledger(out)
    entries = ledger.read().entries
    sources = {entry.key: Path(entry.source) for entry in entries}
    found, problems = [], []
    for row in class_rows([standing(ledger, entry) for entry in entries], ledger):
        why = _why_not(row)
        if row.result is None or why:
            problems.append(f"{one_line(row.id)}: {why}")
            continue
        folder = ledger.folder(row.id)
        copy = folder / STUDENT_FILE
        report = copy if copy.is_file() else folder / REPORT_FILE
        found.append(Feedback(row.id, row.name, for_student(row.result), report, sources[row.id]))
    return found, problems


def write_files(feedback: Feedback, place: Path) -> list[Path]:
    """Write the files for a student's repository into a folder of their own."""
    folder = place / folder_name(feedback.key) / FEEDBACK_FOLDER
    text = f"{render_markdown(feedback.result)}\nThe whole report: `report.html` in this folder.\n"
    files: dict[str, str | bytes] = {"README.md": text, "report.html": feedback.report.read_bytes()}
    for name, content in files.items():
        write_whole(folder / name, content)
    return [folder / name for name in files]


def _why_not(row: ClassRow) -> str:
    """Why a row has nothing for the student to read; empty where it has."""
    if row.result is None or row.status is RowStatus.NOT_GRADED:
        return one_line(row.note) or "not graded"
    waiting = [one.title for one in row.result.adjustments if one.points is None]
    return f"waits for a person: {one_line(', '.join(waiting))}" if waiting else ""


class Addressees:
    """Finds the student of a roster whom a row of the class belongs to."""

    def __init__(self, roster: Roster) -> None:
        """Collect the names of the students."""
        self._named: dict[str, list[Student]] = {}
        for student in roster.students:
            for form in {written(student.key), *student.logins, *student.names}:
                self._named.setdefault(form, []).append(student)

    def of(self, feedback: Feedback) -> Student | None:
        """The only student with that key, else with that name; None where there is none."""
        # A key as the batch makes it of a download from Canvas: name and user.
        parts = feedback.key.rpartition("_")
        return self._only([feedback.key]) or self._only([*parts[::2], feedback.name])

    def _only(self, names: Iterable[str]) -> Student | None:
        found = [one for name in names for one in self._named.get(written(name), ())]
        return found[0] if len({one.row for one in found}) == 1 else None
