"""What each student of a class is given: the student's copy of the result and the report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from grader.batch.ledger import Entry, Ledger
from grader.gradebook.adjusting import ClassAdjustments
from grader.gradebook.class_files import all_standing, class_rows
from grader.gradebook.class_regrading import NOT_UP_TO_DATE, bring_up_to_date
from grader.grading.files import REPORT_FILE, STUDENT_FILE
from grader.report.audience import for_student
from grader.report.files import folder_name, write_whole
from grader.report.formats.gradebook import why_no_score
from grader.report.formats.mail import Letter, address
from grader.report.formats.markdown import render_markdown
from grader.report.model.class_row import RowStatus
from grader.report.model.result_model import Result
from grader.report.text.explanation import summary
from grader.spec.safe_text import one_line

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
    # As after a batch, also reports are written that show checks which are released by now.
    as_fresh = (replace(row, fresh=True) for row in all_standing(ledger))
    done = bring_up_to_date(as_fresh, ledger)
    entries = {row.entry.key: row.entry for row in done}
    visible = ClassAdjustments(ledger).visible
    feedback, problems = [], []
    for row in class_rows(done, ledger):
        entry, why = entries[row.id], why_no_score(row)
        if row.result is not None and row.status in (RowStatus.GRADED, RowStatus.UNREADABLE):
            copy = for_student(row.result, visible)
            file = REPORT_FILE if copy is row.result else STUDENT_FILE
            report = ledger.folder(row.id) / file
            if NOT_UP_TO_DATE not in entry.problem and report.is_file():
                feedback.append(Feedback(entry, copy, report))
                continue
            why = entry.problem or f"{NOT_UP_TO_DATE}: `rosgrade report` writes it again"
        problems.append(f"{one_line(row.id)}: {one_line(why)}")
    return feedback, problems


def letters(feedback: Sequence[Feedback], subject: str) -> tuple[list[Letter], list[str]]:
    """A message for each student who has an address, and who has none."""
    messages, problems = [], []
    for one in feedback:
        # "Lopez, Ana" is Ana Lopez.
        name = " ".join(reversed(one.entry.name.split(",", 1))).strip()
        to = address(one.entry.email, name)
        if to is None:
            email = one_line(one.entry.email) or "in the roster's column `email`"
            problems.append(f"{one_line(one.entry.key)}: has no usable address: {email}")
            continue
        hello = f"Hello {to.display_name}," if to.display_name else "Hello,"
        text = f"{hello}\n\n{summary(one.result)}\nThe report is attached. Open it in a browser.\n"
        title = subject or f"Your result: {one.result.assignment.id}"
        messages.append(Letter(to, title, text, one.report))
    return messages, problems


def write_files(feedback: Feedback, place: Path) -> None:
    """Write the files for a student's repository into a folder of their own."""
    folder = place / folder_name(feedback.entry.key) / FEEDBACK_FOLDER
    readme, report = folder / "README.md", folder / "report.html"
    text = render_markdown(feedback.result)
    write_whole(readme, f"{text}\nThe whole report: `{report.name}` in this folder.\n")
    write_whole(report, feedback.report.read_bytes())
