"""Reports rendered again from what is stored; nothing is run, and no check ends differently."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from datetime import datetime
from functools import cache
from pathlib import Path

from grader.assignment.load import load_assignment
from grader.assignment.selection import select, visible_part
from grader.batch.batch import Done
from grader.batch.ledger import Ledger
from grader.batch.used_assignment import refuse_changed, regrade_command
from grader.errors import RosgradeError, UsageError
from grader.gradebook.adjusting import ClassAdjustments
from grader.grading.files import RESULT_FILE, write_report
from grader.grading.regrading import find_recordings, regrade, stored_assignment
from grader.report.files import write_whole
from grader.report.model.result import read_result, result_json
from grader.report.model.result_model import Result
from grader.report.model.student import VISIBLE_ONLY

NOT_UP_TO_DATE = "its report is not up to date"
_load = cache(load_assignment)


def bring_up_to_date(
    done: Iterable[Done], ledger: Ledger, now: datetime | None = None
) -> list[Done]:
    """Write every report of a class that differs from what is written down about it now.

    That is what a person or a rule of the course adds. A report that cannot be rendered is left as
    it is, and its row says why; the points of the row count all the same.

    Returns:
        The rows with the results as they are now.
    """
    adjust = ClassAdjustments(ledger, now)
    released = adjust.visible - VISIBLE_ONLY
    rows = []
    for before in done:
        row = adjust.row(before)
        entry, result = row.entry, row.result
        shows_more = row.fresh and any(
            check.visibility in released for check in (result.checks if result else ())
        )
        if result != before.result or shows_more:
            try:
                render_again(ledger.folder(entry.key), amended=adjust)
            except RosgradeError as error:
                entry = entry.with_problem(f"{NOT_UP_TO_DATE}: {error}")
        rows.append(replace(row, entry=entry))
    return rows


def render_again(
    folder: Path,
    assignment: str | None = None,
    amended: ClassAdjustments | None = None,
) -> Result:
    """Render the report of one submission again from its result and its recordings.

    Args:
        amended: What is added to the results of its class now.
    """
    found = find_recordings(folder)
    result = found.result or read_result(folder / RESULT_FILE)
    used = result.assignment
    words = ("report", str(folder))
    loaded = _load(assignment or stored_assignment(folder, used.id, used.location, *words))
    refuse_changed(folder, used.sha256, loaded)
    shown = visible_part(loaded) if result.withheld.checks else loaded
    graded = regrade(select(shown, tuple(check.id for check in result.checks)), found)
    before = {check.id: check.status for check in result.checks}
    changed = [one.id for one in graded.grade.results if before.get(one.id) is not one.status]
    if changed:
        raise UsageError(
            f"{folder}: judging again does not give the stored result ({', '.join(changed)}). "
            f"{regrade_command(folder, loaded)} writes the new result and report"
        )
    now = amended(result) if amended is not None else result
    write_report(graded, folder, now, amended.visible if amended is not None else VISIBLE_ONLY)
    if now != result:
        write_whole(folder / RESULT_FILE, result_json(now))
    return now
