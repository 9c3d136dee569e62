"""What each student of a class is given: the student's copy of the result and the report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from grader.batch.class_files import class_rows, standing
from grader.batch.files import REPORT_FILE, STUDENT_FILE
from grader.batch.ledger import Entry, Ledger
from grader.batch.rendering import bring_up_to_date
from grader.report.files import folder_name, write_whole
from grader.report.formats.gradebook import why_no_score
from grader.report.formats.markdown import render_markdown
from grader.report.model.class_row import RowStatus
from grader.report.model.result_model import Result
from grader.report.model.student import for_student
from grader.safe_text import one_line

FEEDBACK_FOLDER = "rosgrade-feedback"


@dataclass(frozen=True)
class Feedback:
    """Of one student; ``result`` and ``report`` say nothing of hidden checks."""

    entry: Entry
    result: Result
    report: Path


def class_feedback(out: Path) -> tuple[list[Feedback], list[str]]:
    """The feedback for each student of a batch, and who cannot get any, with why.

    A report is written again first where a person or a rule of the course added something.
    """
    ledger = Ledger(out)
    before = [standing(ledger, entry) for entry in ledger.read().entries]
    now = bring_up_to_date(before, ledger)
    outdated = {
        one.entry.key for one, old in zip(now, before, strict=True) if one.entry != old.entry
    }
    entries = {one.entry.key: one.entry for one in now}
    found, problems = [], []
    for row in class_rows(now, ledger):
        given = row.status in (RowStatus.GRADED, RowStatus.UNREADABLE) and row.id not in outdated
        if row.result is None or not given:
            why = one_line(row.note) if row.id in outdated else why_no_score(row)
            problems.append(f"{one_line(row.id)}: {why}")
            continue
        folder = ledger.folder(row.id)
        copy = folder / STUDENT_FILE
        report = copy if copy.is_file() else folder / REPORT_FILE
        found.append(Feedback(entries[row.id], for_student(row.result), report))
    return found, problems


def write_files(feedback: Feedback, place: Path) -> list[Path]:
    """Write the files for a student's repository into a folder of their own."""
    folder = place / folder_name(feedback.entry.key) / FEEDBACK_FOLDER
    text = f"{render_markdown(feedback.result)}\nThe whole report: `report.html` in this folder.\n"
    files: dict[str, str | bytes] = {
        "README.md": text,
        "report.html": feedback.report.read_bytes(),
    }
    for name, content in files.items():
        write_whole(folder / name, content)
    return [folder / name for name in files]
