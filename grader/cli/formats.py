"""The formats that ``check`` and ``report`` write beside the report, by their options.

A module of :mod:`grader.report.formats` with a function ``render(result)`` is a format.
Its option is its name, and the first line of its docstring is the help.
"""

from __future__ import annotations

import os
import re
import secrets
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, make_dataclass
from datetime import datetime, timezone
from enum import Enum
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from grader.cli.options import file_option
from grader.errors import GraderFault
from grader.report import formats
from grader.report.files import write_whole

if TYPE_CHECKING:
    from grader.report.model.result_model import Result


_GIT_LIMIT_S = 20.0


class JunitFamily(str, Enum):
    """A dialect of JUnit XML, by pytest's name for it."""

    XUNIT2 = "xunit2"
    XUNIT1 = "xunit1"


_RENDERS = re.compile(r"^def render\(", re.MULTILINE)


def file_formats() -> dict[str, str]:
    """Formats that are written to a file: name of the option -> its help.

    The modules are read and not imported, which takes 0.2 s.
    """
    texts = {
        file.stem: file.read_text() for file in sorted(Path(formats.__file__).parent.glob("*.py"))
    }
    return {
        name: text.partition("\n")[0].strip('"')
        for name, text in texts.items()
        if _RENDERS.search(text)
    }


_FILES = file_formats()
_Files: Any = make_dataclass(
    "_Files",
    [
        (name, Annotated[Path | None, file_option(f"--{name}", text=text)], None)
        for name, text in _FILES.items()
    ],
    frozen=True,
)


@dataclass(frozen=True)
class Formats(_Files):  # type: ignore[misc]
    """What to write, and for each of the formats to which file."""

    junit_family: Annotated[
        JunitFamily,
        typer.Option(
            help="xunit2 is valid for Jenkins; xunit1 also has the student's file and line."
        ),
    ] = JunitFamily.XUNIT2
    gradescope_metadata: Annotated[
        Path | None, typer.Option(help="Gradescope's submission_metadata.json, with the due date.")
    ] = None
    github: Annotated[
        bool,
        typer.Option("--github", help="Write annotations, summary, outputs for GitHub Actions."),
    ] = False
    classroom50 = False

    @property
    def files(self) -> dict[str, Path]:
        """Format -> file, of those that were asked for."""
        files = {name: getattr(self, name) for name in _FILES}
        return {name: file for name, file in files.items() if file is not None}

    @contextmanager
    def grading(self) -> Iterator[None]:
        """A context in which GitHub Actions obeys no command in what a student's code prints."""
        # Each is imported only where it is asked for: together they take 0.2 s.
        if self.classroom50:
            from grader.report.formats import classroom50

            classroom50.identity(os.environ)
        if "gradescope" in self.files:
            from grader.report.formats import gradescope

            write_whole(self.files["gradescope"], gradescope.unfinished())
        if not self.github:
            yield
            return
        token = secrets.token_hex(16)
        print(f"::stop-commands::{token}", flush=True)
        try:
            yield
        finally:
            print(f"::{token}::", flush=True)

    def write(self, result: Result, submission: Path | None = None) -> None:
        """Write everything that was asked for."""
        arguments: dict[str, dict[str, Any]] = {
            "junit": {"xunit1": self.junit_family is JunitFamily.XUNIT1},
            "gradescope": {"metadata": self.gradescope_metadata},
        }
        for name, file in self.files.items():
            module = import_module(f"{formats.__name__}.{name}")
            write_whole(file, module.render(result, **arguments.get(name, {})))
        if self.github:
            _tell_github(result, submission, os.environ)
        if self.classroom50:
            _write_classroom50(result, Path())


@dataclass(frozen=True)
class CheckFormats(Formats):
    """What only ``check`` can write too."""

    classroom50: Annotated[
        bool,
        typer.Option(
            "--classroom50",
            help="Write Classroom 50's result.json and release-body.md here; always ends with 0.",
        ),
    ] = False


def _tell_github(result: Result, submission: Path | None, environment: Mapping[str, str]) -> None:
    from grader.report.formats import github

    prefix = _prefix(submission, Path(environment.get("GITHUB_WORKSPACE") or "."))
    for line in github.annotation_lines(result, prefix):
        print(line, flush=True)
    summary, outputs = environment.get("GITHUB_STEP_SUMMARY"), environment.get("GITHUB_OUTPUT")
    if summary:
        used_bytes = Path(summary).stat().st_size if Path(summary).exists() else 0
        _append(Path(summary), github.summary(result, used_bytes))
    if outputs:
        _append(Path(outputs), github.outputs(result))


def _prefix(submission: Path | None, workspace: Path) -> str | None:
    """Folder of the submission in the repository; None where its files are not there."""
    if submission is None or not submission.is_dir():
        return None
    inside = Path(os.path.relpath(submission.resolve(), workspace.resolve())).as_posix()
    if inside.startswith(".."):
        return None
    return "" if inside == "." else f"{inside}/"


def _append(file: Path, text: str) -> None:
    from grader.errors import UsageError, machine_fault

    try:
        with file.open("a", encoding="utf-8") as stream:
            stream.write(text)
    except OSError as error:
        refusal = UsageError(f"{file} cannot be written: {error.strerror}")
        raise machine_fault(error, file) or refusal from error


def _write_classroom50(result: Result, folder: Path) -> None:
    from grader.report.formats import classroom50

    who = {**classroom50.identity(os.environ), "datetime": _committed(folder)}
    text = classroom50.render_result(result, **who)
    write_whole(folder / classroom50.RESULT_FILE, text)
    write_whole(folder / classroom50.RELEASE_FILE, classroom50.render_release(result))


def _committed(folder: Path) -> str:
    """When the commit that is checked out was made, in UTC; now where there is no commit."""
    from grader.submission.git import run_git

    try:
        shown = run_git(["show", "--no-patch", "--format=%ct", "HEAD"], folder, _GIT_LIMIT_S)
        time = datetime.fromtimestamp(int(shown), timezone.utc)
    except (GraderFault, OSError, OverflowError, ValueError):
        time = datetime.now(timezone.utc)
    return time.strftime("%Y-%m-%dT%H:%M:%SZ")
