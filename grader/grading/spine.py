"""The way of one submission: taken in and built, run until all is decided, judged, written.

``check``, ``watch``, ``batch``, ``selftest`` and the workers of a cluster go down here from
:func:`grade`; what is built already, from :func:`run_and_judge`; ``regrade`` only judges. All end
with :func:`grader.grading.files.write_graded`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from grader.grading.graded import RECORDINGS_FOLDER, Graded
from grader.grading.grading import Grading
from grader.grading.next_runs import next_runs
from grader.grading.runs import Runs
from grader.submission.kept_source import SOURCE_FOLDER
from grader.submission.prepare import Prepared, prepare


@dataclass(frozen=True)
class HandedIn:
    """What is to be graded, and where its files go.

    Attributes:
        path: A folder or an archive.
        folder: Of its report, with its recordings and its source.
        name: How the report calls it; by default as it is called itself.
        given: What the roster says for variables of the assignment, by their names.
        refused: Why it is not read here, where that is known already.
    """

    path: Path
    folder: Path
    name: str | None = None
    given: Mapping[str, str] = field(default_factory=dict)
    refused: Prepared | None = None


def grade(handed_in: HandedIn, grading: Grading) -> Graded:
    """The whole way of one submission, but for what is written of it."""
    prepared = take_in(handed_in, grading)
    return run_and_judge(prepared, grading, handed_in.folder / RECORDINGS_FOLDER)


def take_in(handed_in: HandedIn, grading: Grading) -> Prepared:
    """Read a submission and build it."""
    given = tuple(sorted({**grading.loaded.given, **handed_in.given}.items()))
    source = handed_in.folder / SOURCE_FOLDER
    # Of what is refused nothing is built, so that nothing needs to be there for it.
    prepared = handed_in.refused or prepare(handed_in.path, grading.preparation(given, source))
    record = replace(prepared.record, id=handed_in.name or prepared.record.id, given=given)
    return replace(prepared, record=record)


def run_and_judge(prepared: Prepared, grading: Grading, recordings: Path) -> Graded:
    """Run and judge what was built, until all is decided or nothing more is tried."""
    runs = Runs(grading, prepared, recordings)
    # What is wrong in what was built is known before any run.
    rounds = [runs.judge(())]
    while wanted := next_runs(rounds):
        runs.make(wanted)
        rounds.append(runs.judge(wanted))
    return runs.graded(rounds)
