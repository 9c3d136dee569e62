"""``rosgrade report``: render again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from grader.cli.console import output_console
from grader.cli.formats import (
    Formats,
    Github,
    GradescopeFile,
    GradescopeMetadata,
    JunitFamily,
    JunitFamilyName,
    JunitFile,
    MarkdownFile,
)


def report(
    out: Annotated[Path, typer.Argument(help="A report folder, or the folder of a class.")],
    assignment: Annotated[
        str | None,
        typer.Argument(help="Id or folder; by default the one that it was graded with."),
    ] = None,
    junit: JunitFile = None,
    junit_family: JunitFamilyName = JunitFamily.XUNIT2,
    markdown: MarkdownFile = None,
    gradescope: GradescopeFile = None,
    gradescope_metadata: GradescopeMetadata = None,
    github: Github = False,
) -> None:
    """Render reports again, with other formats if you like. Nothing is run, no grade changes.

    The options of the formats are for one report; of a class every report is rendered.
    """
    from grader.batch.files import REPORT_FILE, RESULT_FILE
    from grader.batch.grading import RECORDINGS_FOLDER
    from grader.batch.rendering import find_reports, render_again, render_all
    from grader.errors import UsageError
    from grader.report.files import refuse_inputs

    folders = find_reports(out)
    formats = Formats(junit, junit_family, markdown, gradescope, gradescope_metadata, github)
    if len(folders) > 1 and formats != Formats(junit_family=junit_family):
        raise UsageError(
            f"{out} has {len(folders)} reports, and a file of one of the formats holds one: "
            "name a report's own folder"
        )
    console = output_console()
    if len(folders) > 1:
        for path in render_all(folders, assignment):
            console.print(f"Report: {path}", soft_wrap=True)
        return
    read = [folders[0] / RESULT_FILE, folders[0] / RECORDINGS_FOLDER, gradescope_metadata]
    refuse_inputs([folders[0] / REPORT_FILE, *formats.files], read)
    written = render_again(folders[0], assignment)
    console.print(f"Report: {written.report}", soft_wrap=True)
    formats.write(written.result)
