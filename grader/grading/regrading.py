"""Judging again from what was recorded; nothing is run."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from grader.assignment.load import LoadedAssignment, list_assignments
from grader.assignment.selection import visible_part
from grader.errors import UsageError
from grader.findings.finding import Status
from grader.grade import Grade, judge_all
from grader.grading.files import RESULT_FILE
from grader.grading.graded import RECORDINGS_FOLDER, SUBMISSION_FILE, Graded
from grader.grading.reference_run import read_references
from grader.machine import resources
from grader.recording.mcap_reader import read_recording
from grader.recording.model import Recording
from grader.recording.submission import SubmissionRecord, read_record
from grader.report.model.result import read_result
from grader.report.model.result_model import Result
from grader.submission.prepare import Prepared


@dataclass(frozen=True)
class FoundRecordings:
    """Recordings of a submission to judge again, with its result if there is one."""

    folder: Path
    recordings: Mapping[str, Recording]
    files: Mapping[str, Path]
    submission: SubmissionRecord
    result: Result | None

    def assignment_folder(self, *command: str) -> str:
        """As :func:`stored_assignment`, of what they were recorded for."""
        if self.result is not None:
            used = self.result.assignment
            return stored_assignment(used.id, used.location, *command)
        for recording in self.recordings.values():
            if name := recording.environment.get("assignment"):
                return stored_assignment(name, None, *command)
        raise UsageError(f"{self.folder}: the assignment is not stored here; name it too")


def find_recordings(path: Path) -> FoundRecordings:
    """Find the recordings at a path."""
    if not path.exists():
        raise UsageError(f"{path}: does not exist")
    folder = path.parent if path.is_file() else path
    if (path / RECORDINGS_FOLDER).is_dir():
        folder = path / RECORDINGS_FOLDER
    report = folder.parent if folder.name == RECORDINGS_FOLDER else folder
    recordings, files = {}, {}
    for file in [path] if path.is_file() else sorted(folder.glob("*.mcap")):
        recording = read_recording(file)
        recordings[recording.scenario] = recording
        files[recording.scenario] = file
    facts = folder / SUBMISSION_FILE
    if path.is_dir() and facts.is_file():
        submission = read_record(facts)
    elif recordings:
        submission = next(iter(recordings.values())).submission
    else:
        raise UsageError(f"{path}: there are no recordings in it")
    result = read_result(report / RESULT_FILE) if (report / RESULT_FILE).is_file() else None
    return FoundRecordings(report, recordings, files, submission, result)


def stored_assignment(name: str, location: str | None, *command: str) -> str:
    """The folder of the assignment that something was graded with, to load it again.

    Args:
        location: Where it lay; None for one of rosgrade's own, or where it is not known.
        command: What the user asked for: the subcommand, then the path of what was graded.
    """
    if location is None and name in list_assignments():
        # And not one of that name in the current folder.
        return str(resources.assignments() / name)
    if location is not None and Path(location).exists():
        return location
    lay = f" in {location}, which does not exist any more" if location else ""
    raise UsageError(
        f"{command[1]}: was graded with the assignment {name!r}{lay}; name its folder: "
        f"`{shlex.join(('rosgrade', *command))} FOLDER`"
    )


def refuse_other(folder: Path, name: str, loaded: LoadedAssignment) -> None:
    """Refuse to judge a recording with another assignment: all points would be lost."""
    if name != loaded.assignment.id:
        raise UsageError(f"{folder}: holds the grades of {name}, not of {loaded.assignment.id}")


def regrade(loaded: LoadedAssignment, found: FoundRecordings) -> Graded:
    """Judge what was recorded with an assignment as it is now.

    A result that was made for a student is judged again as far as the student may see it.
    """
    if found.result is not None and found.result.withheld.checks:
        loaded = visible_part(loaded)
    return Graded(
        grade=judge_all(loaded, found.submission, found.recordings),
        prepared=Prepared(record=found.submission, install=None),
        recordings=found.recordings,
        files=found.files,
        runs={one.id: one.runs for one in found.result.scenarios} if found.result else {},
        references=read_references(loaded),
    )


def compare(before: Result, after: Grade) -> list[str]:
    """Say which checks changed, one line each."""
    earlier = {check.id: check for check in before.checks}
    lines = []
    for result in after.results:
        check, status = earlier.pop(result.id, None), result.status
        if check is None:
            lines.append(f"{result.id}: new, {status.value}, {result.points:g} points")
        elif (check.status, check.points) != (status, result.points):
            why = result.decisive.finding.observed.partition("\n")[0]
            is_judged = Status.ERROR not in (check.status, status)
            points = f", {check.points:g} -> {result.points:g} points" if is_judged else ""
            lines.append(f"{result.id}: {check.status.value} -> {status.value}{points}: {why}")
    lines += [f"{name}: no longer in the assignment" for name in earlier]
    score = after.score if after.graded else None
    if before.score != score:
        most = f" of {after.max_score:g}" if score is not None else ""
        lines.append(f"score: {_shown(before.score)} -> {_shown(score)}{most}")
    return lines


def _shown(score: float | None) -> str:
    return "not graded" if score is None else f"{score:g}"
