"""Judging again from what was recorded; nothing is run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from grader.assignment.load import LoadedAssignment
from grader.assignment.selection import visible_part
from grader.batch.files import RESULT_FILE
from grader.batch.grading import RECORDINGS_FOLDER, SUBMISSION_FILE, Graded
from grader.batch.reference_run import read_references
from grader.checks.finding import Status
from grader.errors import UsageError
from grader.grade import Grade, grade
from grader.recording.mcap_reader import read_recording
from grader.recording.model import Recording
from grader.report.result import read_result
from grader.report.result_model import Result
from grader.submission.prepare import Prepared
from grader.submission.record import SubmissionRecord
from grader.submission.record_json import read_record


@dataclass(frozen=True)
class Found:
    """What there is to judge again.

    Attributes:
        folder: The report's folder; for single recordings the folder that they are in.
        recordings: By scenario.
        files: Their files.
        submission: The facts of the submission.
        result: The result until now, or None where there is none.
    """

    folder: Path
    recordings: Mapping[str, Recording]
    files: Mapping[str, Path]
    submission: SubmissionRecord
    result: Result | None

    @property
    def assignment(self) -> str:
        """Id of the assignment that it was recorded for.

        Raises:
            UsageError: It is not known.
        """
        if self.result is not None:
            return self.result.assignment.id
        for recording in self.recordings.values():
            if "assignment" in recording.environment:
                return recording.environment["assignment"]
        raise UsageError(f"{self.folder}: it does not say for which assignment; name it")


def find(path: Path) -> Found:
    """Find the recordings at a path.

    Args:
        path: A report folder, its folder of recordings, or one ``.mcap`` file.

    Raises:
        UsageError: There is nothing to judge, or a file is damaged.
    """
    if not path.exists():
        raise UsageError(f"{path}: does not exist")
    if path.is_file():
        recording = read_recording(path)
        files = {recording.scenario: path}
        return Found(
            path.parent, {recording.scenario: recording}, files, recording.submission, None
        )
    folder = path / RECORDINGS_FOLDER if (path / RECORDINGS_FOLDER).is_dir() else path
    recordings, files = {}, {}
    for file in sorted(folder.glob("*.mcap")):
        recording = read_recording(file)
        recordings[recording.scenario] = recording
        files[recording.scenario] = file
    facts = folder / SUBMISSION_FILE
    if not recordings and not facts.is_file():
        raise UsageError(f"{path}: there are no recordings in it")
    submission = (
        read_record(facts) if facts.is_file() else next(iter(recordings.values())).submission
    )
    report = folder.parent if folder.name == RECORDINGS_FOLDER else folder
    result = read_result(report / RESULT_FILE) if (report / RESULT_FILE).is_file() else None
    return Found(report, recordings, files, submission, result)


def refuse_other(folder: Path, name: str, loaded: LoadedAssignment) -> None:
    """Let nobody lose all points because a recording is judged as of another assignment.

    Args:
        folder: With results.
        name: Id of the assignment that they are of.
        loaded: To judge with.

    Raises:
        UsageError: It is another one.
    """
    if name != loaded.assignment.id:
        raise UsageError(f"{folder}: holds the grades of {name}, not of {loaded.assignment.id}")


def regrade(loaded: LoadedAssignment, found: Found) -> Graded:
    """Judge what was recorded with an assignment as it is now.

    A result that was made for a student is judged again as far as the student may see it.
    """
    if found.result is not None and found.result.withheld.checks:
        loaded = visible_part(loaded)
    return Graded(
        grade=grade(loaded, found.submission, found.recordings),
        prepared=Prepared(record=found.submission, install=None),
        recordings=found.recordings,
        files=found.files,
        runs={},
        faults={},
        references=read_references(loaded),
    )


def compare(before: Result, after: Grade) -> list[str]:
    """Say which checks changed, one line each."""
    old = {check.id: check for check in before.checks}
    lines = []
    for result in after.results:
        was = old.pop(result.id, None)
        if was is None:
            lines.append(f"{result.id}: new, {result.status.value}, {result.points:g} points")
        elif (was.status, was.points) != (result.status, result.points):
            why = result.decisive.finding.observed.partition("\n")[0]
            judged = Status.ERROR not in (was.status, result.status)
            points = f", {was.points:g} -> {result.points:g} points" if judged else ""
            lines.append(f"{result.id}: {was.status.value} -> {result.status.value}{points}: {why}")
    lines += [f"{name}: no longer in the assignment" for name in old]
    score = after.score if after.graded else None
    if before.score != score:
        earlier, now = (
            "not graded" if points is None else f"{points:g}" for points in (before.score, score)
        )
        most = f" of {after.max_score:g}" if score is not None else ""
        lines.append(f"score: {earlier} -> {now}{most}")
    return lines
