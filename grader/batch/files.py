"""The files that grading one submission leaves."""

from __future__ import annotations

import os
from pathlib import Path

from grader import __version__
from grader.batch.grading import Graded
from grader.report.facts import Clock, RunFacts
from grader.report.files import write_whole
from grader.report.html import render_report
from grader.report.result import write_result

REPORT_FILE = "report.html"
RESULT_FILE = "result.json"


def write_graded(graded: Graded, folder: Path, clock: Clock, json_file: Path | None = None) -> Path:
    """Write report and result of a submission.

    Args:
        graded: What was graded.
        folder: For ``report.html`` and ``result.json``.
        clock: Started when grading began.
        json_file: One more place for the result, or None.

    Returns:
        The report.
    """
    first = next(iter(graded.recordings.values()), None)
    facts = RunFacts(
        started=clock.started,
        duration_s=clock.elapsed_s,
        environment=first.environment if first else {},
        rosgrade_version=__version__,
        recordings={name: os.path.relpath(file, folder) for name, file in graded.files.items()},
    )
    for target in (folder / RESULT_FILE, json_file):
        if target is not None:
            write_result(graded.grade, graded.recordings, facts, target)
    report = folder / REPORT_FILE
    write_whole(report, render_report(graded.grade, graded.recordings, facts))
    return report
