"""``make demo``: grade the reference solution of timed_publisher, then a broken submission."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from grader.assignment.changed_reference import apply
from grader.assignment.load import load_assignment
from grader.assignment.mutant_file import load_mutants

ASSIGNMENT = "timed_publisher"
BROKEN = "sleeps_in_main"
REPORTS = Path("rosgrade-report")


def main() -> int:
    """Grade both; 0 if the first gets full points and the second loses some."""
    loaded = load_assignment(ASSIGNMENT)
    mutants = load_mutants(loaded.assignment, loaded.folder)
    broken = REPORTS / "broken-submission"
    shutil.rmtree(broken, ignore_errors=True)
    mutant = next(m for m in mutants.mutants if m.id == BROKEN)
    apply(mutant, mutants.reference, broken)
    right = _check(mutants.reference, REPORTS / "reference")
    print(f"\nThe same with one mistake in it: {mutant.title}.\n", flush=True)
    wrong = _check(broken, REPORTS / "broken")
    print(f"\nOpen {REPORTS}/reference/report.html and {REPORTS}/broken/report.html.")
    return 0 if (right, wrong) == (0, 1) else 1


def _check(submission: Path, report: Path) -> int:
    arguments = ["check", ASSIGNMENT, os.path.relpath(submission), "--report", str(report)]
    print(f"$ rosgrade {' '.join(arguments)}", flush=True)
    return subprocess.run([sys.executable, "-m", "grader", *arguments], check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
