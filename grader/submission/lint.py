"""What ruff finds in a student's Python files.

Every rule is asked for, and what a lesson wants is chosen when it is judged, so that a regrade
with other rules needs neither the files nor ruff. Neither a configuration nor ``# noqa`` of the
student's has a say.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sysconfig
from collections import Counter
from collections.abc import Collection
from functools import cache
from pathlib import Path

from grader.errors import GraderFault
from grader.submission.bounded import OutputLimits, run_bounded
from grader.submission.code_facts import Lint, LintFinding
from grader.submission.paths import shown

LINE_LENGTH = 99
"""Of the ROS 2 style guide for Python."""

EXCLUDED = {"D203": "D211", "D213": "D212"}
"""Rules that ruff leaves out, each since it contradicts another one that it has."""

_PYTHON = "py312"
_WALL_S = 20.0
# No finding is decided by more places of one rule than a student can look at.
_MOST_PLACES = 20


def find_ruff() -> Path | None:
    """The program: of this Python environment, or else on the path."""
    own = Path(sysconfig.get_path("scripts")) / "ruff"
    found = str(own) if own.is_file() else shutil.which("ruff")
    return Path(found) if found else None


@cache
def known_rules(ruff: Path) -> frozenset[str]:
    """Codes of all rules that ruff can report.

    Raises:
        GraderFault: It does not tell.
    """
    try:
        told = subprocess.run(
            [str(ruff), "rule", "--all", "--output-format", "json"],
            capture_output=True,
            timeout=_WALL_S,
            check=True,
        )
        codes = {rule["code"] for rule in json.loads(told.stdout)}
        return frozenset(code for code in codes if isinstance(code, str)) - EXCLUDED.keys()
    except (OSError, subprocess.SubprocessError, ValueError, KeyError, TypeError) as error:
        raise GraderFault(f"{ruff} does not tell its rules: {error}") from error


def lint(root: Path, files: Collection[str], ruff: Path | None = None) -> Lint:
    """Let ruff look at files; they are neither changed nor run.

    Args:
        root: Folder of the submission's private copy.
        files: Paths in it.
        ruff: The program, by default the one that is found.
    """
    ruff = ruff or find_ruff()
    if ruff is None:
        return Lint("ruff is not installed: `pip install ruff`")
    if not files:
        return Lint()
    found: list[LintFinding] = []

    def take(line: str) -> None:
        finding = _finding(line, root)
        if finding is not None:
            found.append(finding)

    options = (
        "--isolated --no-cache --no-fix --exit-zero --ignore-noqa --no-respect-gitignore --quiet "
        f"--select ALL --line-length {LINE_LENGTH} --target-version {_PYTHON} "
        "--output-format json-lines"
    )
    try:
        outcome = run_bounded(
            [str(ruff), "check", *options.split(), "--", *(f"./{file}" for file in sorted(files))],
            cwd=root,
            environment={"PATH": os.defpath},
            wall_s=_WALL_S,
            output=OutputLimits(head=0, tail=2000),
            on_line=take,
        )
    except GraderFault as fault:
        return Lint(f"ruff could not be run: {fault}")
    if outcome.status != 0:
        how = f"was ended for its {outcome.ended_by_us}" if outcome.ended_by_us else "failed"
        return Lint(f"ruff {how}")
    return Lint(None, _first_of_each(found))


def _finding(line: str, root: Path) -> LintFinding | None:
    """What a line of ruff's output says; None for other output, and for syntax errors."""
    try:
        said = json.loads(line)
        code, message = str(said["code"]), str(said["message"])
        file = os.path.relpath(said["filename"], root)
        number = int(said["location"]["row"])
    except (ValueError, KeyError, TypeError):
        return None
    if not code[:1].isupper():
        return None
    return LintFinding(code, shown(file), number, shown(message.partition("\n")[0]))


def _first_of_each(found: list[LintFinding]) -> tuple[LintFinding, ...]:
    seen: Counter[str] = Counter()
    kept = []
    for finding in sorted(found, key=lambda item: (item.file, item.line, item.code)):
        seen[finding.code] += 1
        if seen[finding.code] <= _MOST_PLACES:
            kept.append(finding)
    return tuple(kept)
