"""What ruff finds in a student's Python files.

Every rule is asked for, and what a lesson wants is chosen when it is judged, so that a regrade
with other rules needs neither the files nor ruff. Neither a configuration nor ``# noqa`` of the
student's has a say.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
from collections import Counter
from collections.abc import Collection, Iterator
from functools import cache
from pathlib import Path

from grader.errors import GraderFault
from grader.recording.submission import Lint, LintFinding, SourceError
from grader.submission.build.bounded import Command, OutputLimits, run_bounded
from grader.submission.intake.paths import shown

LINE_LENGTH = 99
"""Of the ROS 2 style guide for Python."""

EXCLUDED = {"D203": "D211", "D213": "D212"}
"""Rules that ruff leaves out, each since it contradicts another one that it has."""

_PYTHON = (3, 12)
"""The Python of ROS 2 Jazzy."""
_NEWER = re.compile(r"on Python [\d.]+ \(syntax was added in Python (\d+)\.(\d+)\)")
_WALL_S = 20.0
# More places of one rule help no student.
_MOST_PLACES = 20


def find_ruff() -> Path | None:
    """The program: of this Python environment, or else on the path."""
    own = Path(sysconfig.get_path("scripts")) / "ruff"
    found = str(own) if own.is_file() else shutil.which("ruff")
    return Path(found) if found else None


@cache
def known_rules(ruff: Path) -> frozenset[str]:
    """Codes of all rules that ruff can report."""
    try:
        listed = subprocess.run(
            [str(ruff), "rule", "--all", "--output-format", "json"],
            capture_output=True,
            timeout=_WALL_S,
            check=True,
        )
        codes = {rule["code"] for rule in json.loads(listed.stdout)}
        return frozenset(code for code in codes if isinstance(code, str)) - EXCLUDED.keys()
    except (OSError, subprocess.SubprocessError, ValueError, KeyError, TypeError) as error:
        raise GraderFault(f"{ruff} does not list its rules: {error}") from error


def lint(root: Path, files: Collection[str], ruff: Path | None = None) -> Lint:
    """Let ruff look at files; they are neither changed nor run."""
    ruff = ruff or find_ruff()
    if ruff is None:
        return Lint("ruff is not installed: `pip install ruff`")
    problem, found = _check(ruff, root, files, _PYTHON)
    seen: Counter[str] = Counter()
    kept = []
    for finding in sorted(found, key=lambda item: (item.file, item.line, item.code)):
        seen[finding.code] += 1
        if not _is_syntax_error(finding) and seen[finding.code] <= _MOST_PLACES:
            kept.append(finding)
    return Lint(problem, () if problem else tuple(kept))


def newer_syntax(
    root: Path, files: Collection[str], python: tuple[int, int] = sys.version_info[:2]
) -> tuple[SourceError, ...]:
    """Find files that only the Python of ROS 2 Jazzy can parse, and not the one that is here."""
    ruff = find_ruff()
    if python >= _PYTHON or ruff is None:
        return ()
    problem, found = _check(ruff, root, files, python)
    errors: dict[str, list[LintFinding]] = {}
    for item in found if problem is None else ():
        if _is_syntax_error(item):
            errors.setdefault(item.file, []).append(item)
    return tuple(
        SourceError(file, items[0].line, items[0].message)
        for file, items in sorted(errors.items())
        if all(map(_is_jazzy_syntax, items))
    )


def _is_syntax_error(finding: LintFinding) -> bool:
    """Whether a finding is a syntax error: its code is a word and does not begin with a family."""
    return not finding.code[:1].isupper()


def _is_jazzy_syntax(error: LintFinding) -> bool:
    newer = _NEWER.search(error.message)
    return newer is not None and (int(newer[1]), int(newer[2])) <= _PYTHON


def _check(
    ruff: Path, root: Path, files: Collection[str], python: tuple[int, int]
) -> tuple[str | None, list[LintFinding]]:
    """Run ruff with all rules; why that was not possible, or None, and what it finds."""
    found: list[LintFinding] = []
    if not files:
        return None, found
    options = (
        "--isolated --no-cache --no-fix --exit-zero --ignore-noqa --no-respect-gitignore --quiet "
        f"--select ALL --line-length {LINE_LENGTH} --target-version py{python[0]}{python[1]} "
        "--output-format json-lines"
    )
    paths = (f"./{file}" for file in sorted(files))
    arguments = [str(ruff), "check", *options.split(), "--", *paths]
    try:
        outcome = run_bounded(
            Command(arguments, root, {"PATH": os.defpath}),
            wall_s=_WALL_S,
            output=OutputLimits(head=0, tail=2000),
            on_line=lambda line: found.extend(_findings(line, root)),
        )
    except GraderFault as fault:
        return f"ruff could not be run: {fault}", found
    if outcome.ended_by_us:
        return f"ruff was ended: too much {outcome.ended_by_us}", found
    return "ruff failed" if outcome.status else None, found


def _findings(line: str, root: Path) -> Iterator[LintFinding]:
    """The findings in a line of ruff's output; none in other output."""
    try:
        found = json.loads(line)
        code, message = str(found["code"]), str(found["message"])
        file = os.path.relpath(found["filename"], root)
        number = int(found["location"]["row"])
    except (ValueError, KeyError, TypeError):
        return
    yield LintFinding(code, shown(file), number, shown(message.partition("\n")[0]))
