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
    beside = Path(sysconfig.get_path("scripts")) / "ruff"
    program = str(beside) if beside.is_file() else shutil.which("ruff")
    return Path(program) if program else None


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
    problem, findings = _check(ruff, root, files, _PYTHON)
    if problem:
        return Lint(problem, ())
    places: Counter[str] = Counter()
    kept = []
    for finding in sorted(findings, key=lambda item: (item.file, item.line, item.code)):
        places[finding.code] += 1
        if not _is_syntax_error(finding) and places[finding.code] <= _MOST_PLACES:
            kept.append(finding)
    return Lint(None, tuple(kept))


def newer_syntax(
    root: Path, files: Collection[str], python: tuple[int, int] = sys.version_info[:2]
) -> tuple[SourceError, ...]:
    """Find files that only the Python of ROS 2 Jazzy can parse, and not the one that is here."""
    ruff = find_ruff()
    if python >= _PYTHON or ruff is None:
        return ()
    problem, findings = _check(ruff, root, files, python)
    if problem:
        return ()
    errors: dict[str, list[LintFinding]] = {}
    for finding in findings:
        if _is_syntax_error(finding):
            errors.setdefault(finding.file, []).append(finding)
    return tuple(
        SourceError(file, in_file[0].line, in_file[0].message)
        for file, in_file in sorted(errors.items())
        if all(map(_is_jazzy_syntax, in_file))
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
    findings: list[LintFinding] = []
    if not files:
        return None, findings
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
            on_line=lambda line: findings.extend(_findings(line, root)),
        )
    except GraderFault as fault:
        return f"ruff could not be run: {fault}", findings
    if outcome.ended_by_us:
        return f"ruff was ended: too much {outcome.ended_by_us}", findings
    return "ruff failed" if outcome.status else None, findings


def _findings(line: str, root: Path) -> Iterator[LintFinding]:
    """The findings in a line of ruff's output; none in other output."""
    try:
        said = json.loads(line)
        code, message = str(said["code"]), str(said["message"])
        file = os.path.relpath(said["filename"], root)
        row = int(said["location"]["row"])
    except (ValueError, KeyError, TypeError):
        return
    yield LintFinding(code, shown(file), row, shown(message.partition("\n")[0]))
