"""A graded submission, with everything that its grade is made from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from grader.grade import Grade
from grader.recording.model import Recording
from grader.report.html.replay import Replay
from grader.submission.prepare import Prepared

RECORDINGS_FOLDER = "recordings"
SUBMISSION_FILE = "submission.json"


@dataclass(frozen=True)
class Graded:
    """A graded submission.

    Attributes:
        recordings: By scenario id, as the others.
        runs: How often each scenario was run; runs that only put names right do not count.
        references: Runs of the reference, to be drawn beside these.
        repeats: Why runs were repeated, one text for each.
    """

    grade: Grade
    prepared: Prepared
    recordings: Mapping[str, Recording]
    files: Mapping[str, Path]
    runs: Mapping[str, int]
    references: Mapping[str, Replay] = field(default_factory=dict)
    repeats: tuple[str, ...] = ()
