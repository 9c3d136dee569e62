"""The files that are written for one graded submission."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

from grader import __version__
from grader.errors import UsageError
from grader.grading.graded import RECORDINGS_FOLDER, SUBMISSION_FILE, Graded
from grader.grading.last_attempt import keep_replays, replays_before
from grader.report.audience import VISIBLE_ONLY, for_student
from grader.report.files import write_whole
from grader.report.formats.foxglove import LAYOUT_FILE, render_layout
from grader.report.html.report import render_report
from grader.report.html.source_code import ShownSource
from grader.report.model.facts import Clock, RunFacts
from grader.report.model.result import make_result, result_json
from grader.report.model.result_model import Result
from grader.submission.kept_source import SOURCE_FOLDER, read_kept_source

REPORT_FILE = "report.html"
STUDENT_FILE = "student-report.html"
"""The report without hidden checks; only where there are some."""
RESULT_FILE = "result.json"
INSTALL_FOLDER = "install"
_MARK = ".rosgrade-report"


def write_graded(
    graded: Graded,
    folder: Path,
    clock: Clock,
    json_file: Path | None = None,
    amended: Callable[[Result], Result] = lambda result: result,
    root: Path | None = None,
) -> Result:
    """Write report and result of a submission.

    Args:
        amended: Adds to the result what is not in the grade, such as earlier attempts.
        root: The submission where the reader of the report has it; see :func:`write_report`.
    """
    first = next(iter(graded.recordings.values()), None)
    facts = RunFacts(
        started=clock.started,
        duration_s=clock.elapsed_s,
        environment=first.environment if first else {},
        rosgrade_version=__version__,
        recordings={name: os.path.relpath(file, folder) for name, file in graded.files.items()},
        runs=graded.runs,
    )
    result = amended(make_result(graded.grade, graded.recordings, facts))
    if root is not None:
        keep_replays(folder, graded)
    write_report(graded, folder, result, root=root)
    # Last, so that the report beside a result always has the same grade.
    for file in (folder / RESULT_FILE, json_file):
        if file is not None:
            write_whole(file, result_json(result))
    return result


def write_report(
    graded: Graded,
    folder: Path,
    result: Result,
    visible: frozenset[str] = VISIBLE_ONLY,
    root: Path | None = None,
) -> None:
    """Write ``report.html``, and a Foxglove layout beside the recordings.

    Where checks are hidden, the copy that a student may see is written too; ``visible`` are the
    visibilities in it. Of a submission that is a folder, ``root``, the report links the files.
    """
    if graded.recordings and (folder / RECORDINGS_FOLDER).is_dir():
        layout = render_layout(graded.recordings.values())
        write_whole(folder / RECORDINGS_FOLDER / LAYOUT_FILE, layout)
    source = read_kept_source(folder / SOURCE_FOLDER).files
    before = replays_before(folder, result.submission.sha256)
    shown = (graded.recordings, graded.references, before)
    root = root.resolve() if root is not None and root.is_dir() else None
    html = render_report(graded.grade, result, *shown, ShownSource(source, root))
    write_whole(folder / REPORT_FILE, html)
    copy, file = for_student(result, visible), folder / STUDENT_FILE
    if copy is result:
        file.unlink(missing_ok=True)
    else:
        html = render_report(graded.grade, copy, *shown, ShownSource(source, None))
        write_whole(file, html)


def claim(folder: Path, *, keep: bool) -> None:
    """Mark a folder as a place for reports, where the next run may write if this one is cut off.

    Raises:
        UsageError: Something of somebody else's is in the place of a folder that would be replaced.
    """
    recordings, mark = folder / RECORDINGS_FOLDER, folder / _MARK
    others = []
    if any(recordings.glob("*.mcap")) and not (recordings / SUBMISSION_FILE).is_file():
        others.append(recordings)
    if not ((folder / RESULT_FILE).is_file() or mark.is_file()):
        others.append(folder / SOURCE_FOLDER)
        if keep:
            others.append(folder / INSTALL_FOLDER)
    other = next(filter(Path.exists, others), None)
    if other is not None:
        raise UsageError(f"{other}: does not belong to a report, so it stays; use another folder")
    write_whole(mark, "rosgrade writes its reports here, over those of before.\n")


def keep_install(graded: Graded, folder: Path) -> Path | None:
    """Copy what colcon installed, to look at and source; None where nothing was built."""
    install = graded.prepared.install
    if install is None:
        return None
    target = folder / INSTALL_FOLDER
    try:
        shutil.rmtree(target, ignore_errors=True)
        shutil.copytree(install, target, symlinks=True, copy_function=shutil.copyfile)
        for file in (target, *target.rglob("*")):
            if not file.is_symlink():
                file.chmod((install / file.relative_to(target)).stat().st_mode | 0o200)
    except OSError as error:
        raise UsageError(f"{target} cannot be written: {error.strerror or error}") from error
    return target
