"""What the runner is asked for: one scenario with a submission that is built."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from grader.recording.submission import SubmissionRecord
from grader.run.imposing.mistake import Mistake
from grader.spec.names import NO_NAMES, Names

if TYPE_CHECKING:
    from grader.assignment.model import Assignment, Scenario


def scenario_seed(assignment: str, scenario: str, submission_sha256: str, base: int | None) -> int:
    """Seed of a scenario, in [0, 2**63), from the submission's hash, so that none can be guessed.

    Args:
        base: A seed that the caller gave; replaces the submission.
    """
    origin = submission_sha256 if base is None else str(base)
    digest = hashlib.sha256(f"{assignment}/{scenario}/{origin}".encode()).digest()
    return int.from_bytes(digest[:8], "big") >> 1


@dataclass(frozen=True)
class RunRequest:
    """One scenario to run with a submission that is built.

    Attributes:
        install: The submission's install space (merged layout).
        worlds: Folder that world files are relative to.
        underlays: Of the submission; by default those of the runner's ROS.
        names: Wrong names to put right.
        pauses: Whether the executors pause after the observation.
        mistakes: What is imposed on its programs; of selftest only.
    """

    assignment: Assignment
    scenario: Scenario
    submission: SubmissionRecord
    install: Path
    seed: int
    worlds: Path = Path()
    underlays: tuple[Path, ...] = ()
    type_support: tuple[Path, ...] = ()
    names: Names = NO_NAMES
    pauses: bool = False
    mistakes: tuple[Mistake, ...] = ()
