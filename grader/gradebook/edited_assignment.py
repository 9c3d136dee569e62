"""An assignment that was edited, to try it on a class, to use it, and to go back.

``OUT/assignment/<number>/`` holds each version that was used: the whole folder of the assignment,
and in ``before.json`` the assignment that the class was graded with before.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from grader.assignment.load import ASSIGNMENT_FILE, LoadedAssignment, load_assignment
from grader.batch.ledger import Ledger
from grader.errors import AssignmentError, RosgradeError, UsageError, machine_fault
from grader.grading.regrading import stored_assignment
from grader.report.files import write_whole

FOLDER = "assignment"
_BEFORE = "before.json"
_LEFT_OUT = shutil.ignore_patterns(".*", "__pycache__", "rosgrade-report")


def with_text(loaded: LoadedAssignment, text: str, place: Path) -> LoadedAssignment:
    """Copy an assignment, with another text of its YAML file.

    Args:
        place: A folder for the copy; it is removed if the text is wrong.

    Raises:
        AssignmentError: It is wrong.
    """
    if loaded.file.name != ASSIGNMENT_FILE:
        raise UsageError(f"{loaded.file}: only an assignment in a folder of its own can be edited")
    folder = place / loaded.assignment.id
    try:
        shutil.copytree(loaded.folder, folder, ignore=_LEFT_OUT)
    except OSError as error:
        refusal = UsageError(f"{folder}: {error.strerror or error}")
        raise machine_fault(error, folder) or refusal from error
    try:
        write_whole(folder / ASSIGNMENT_FILE, text.replace("\r\n", "\n"))
        return load_assignment(folder)
    except RosgradeError as error:
        shutil.rmtree(place, ignore_errors=True)
        if isinstance(error, AssignmentError) and error.file.is_relative_to(folder):
            file = error.file.relative_to(folder)
            raise AssignmentError(file, list(error.problems)) from error
        raise


def new_place(ledger: Ledger) -> Path:
    """A new folder for a version that is used, where what is used until now is written down."""
    there = [int(one.name) for one in (ledger.out / FOLDER).glob("*") if one.name.isdecimal()]
    place = ledger.out / FOLDER / str(max(there, default=0) + 1)
    before = json.dumps({"location": ledger.read().location}) + "\n"
    write_whole(place / _BEFORE, before)
    return place


def load_before(ledger: Ledger) -> LoadedAssignment | None:
    """The assignment before the one that the class is graded with; None if that is the first."""
    out, used = ledger.out, ledger.read()
    file = Path(used.location or "").parent / _BEFORE
    if not file.is_file():
        return None
    before = json.loads(file.read_text())["location"]
    return load_assignment(stored_assignment(used.assignment, before, "regrade", str(out)))
