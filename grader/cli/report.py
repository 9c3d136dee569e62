"""``rosgrade report``: render again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from grader.batch.groups import regroup
from grader.batch.ledger import Ledger
from grader.cli.formats import Formats
from grader.cli.option_group import with_option_groups
from grader.cli.options import UsedAssignment
from grader.cli.screen.console import print_warning, say
from grader.errors import UsageError
from grader.gradebook.adjusting import ClassAdjustments, course_of
from grader.gradebook.class_files import all_standing, find_reports, write_class
from grader.gradebook.class_regrading import bring_up_to_date, render_again
from grader.grading.files import REPORT_FILE, RESULT_FILE
from grader.grading.graded import RECORDINGS_FOLDER
from grader.report.files import refuse_inputs


@with_option_groups
def report(
    out: Annotated[Path, typer.Argument(help="A report folder, or the folder of a class.")],
    assignment: UsedAssignment = None,
    *,
    formats: Formats,
) -> None:
    """Write reports again, also in other formats. Nothing is run or judged.

    The options of the formats work for one report. For a class, this writes every report, the
    gradebook and the overview, with everything that you wrote in `rosgrade review`.
    """
    ledger = Ledger.around(out)
    rules = course_of(ledger.out, None, ledger.read().assignment) if ledger is not None else None
    if ledger is not None and rules is not None:
        with ledger.opened():
            regroup(ledger, rules)
    folders = find_reports(out)
    if len(folders) > 1 and formats != Formats(junit_family=formats.junit_family):
        raise UsageError(
            f"{out} has {len(folders)} reports, and a file of such a format holds one: "
            "give the folder of one report"
        )
    adjust = ClassAdjustments(ledger) if ledger is not None else None
    for key in adjust.vanished() if adjust is not None else ():
        print_warning(f"the review of {key} stays, but the class has no such student")
    for folder in folders:
        read = [folder / RESULT_FILE, folder / RECORDINGS_FOLDER, formats.gradescope_metadata]
        refuse_inputs([folder / REPORT_FILE, *formats.files.values()], read)
        formats.write(render_again(folder, assignment, adjust))
        say(f"Report: {folder / REPORT_FILE}")
    if ledger is not None:
        rows = bring_up_to_date(all_standing(ledger), ledger)
        say(f"Overview: {write_class(rows, ledger)}")
