"""The student's own tests: what pytest prints of them."""

from __future__ import annotations

import re

from grader.recording.submission import PytestRecord
from grader.submission.build.bounded import Outcome

_OPTIONS = "-q --tb=short -rfEp -p no:cacheprovider -o addopts= --color=no"
# Made by `ros2 pkg create`: linters of ament, and no tests of the student's.
_LINTERS = ("copyright", "flake8", "pep257")
LIBRARY = "pytest"
WALL_S = 120.0
COLUMNS = "400"
"""pytest cuts messages at the width of the terminal."""
_MOST_FAILURES = 100
_RESULT = re.compile(r"^(PASSED|FAILED|ERROR) (\S+)(?: - (.*))?$", re.MULTILINE)
_ALL_PASSED, _SOME_FAILED, _NO_TESTS = 0, 1, 5
# A module that cannot be imported ends the collection of all tests.
_COLLECTION_FAILED = 2


def pytest_options(folder: str) -> list[str]:
    """Arguments of pytest for the package in a folder."""
    ignored = [f"--ignore-glob={folder}/*test_{linter}.py" for linter in _LINTERS]
    return [*_OPTIONS.split(), *ignored, "--rootdir", folder, folder]


def pytest_record(package: str, outcome: Outcome, folder: str) -> PytestRecord:
    """What a run of pytest says.

    Args:
        folder: Where the package lies, as seen from the working directory; file names are shown
            relative to it.
    """
    results = _RESULT.findall(outcome.output.replace(f"{folder}/", ""))
    failed = [(name, message) for result, name, message in results if result != "PASSED"]
    problem = None
    if outcome.ended_by_us:
        problem = f"pytest was ended: {outcome.ended_by_us}"
    elif outcome.status == _NO_TESTS:
        problem = "pytest found no test"
    elif outcome.status not in (_ALL_PASSED, _SOME_FAILED) and not (
        outcome.status == _COLLECTION_FAILED and failed
    ):
        problem = f"pytest ended with status {outcome.status}: {outcome.output.strip()[-300:]}"
    passed = sum(result == "PASSED" for result, _, _ in results)
    return PytestRecord(package, passed, tuple(failed[:_MOST_FAILURES]), problem)
