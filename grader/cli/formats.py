"""The formats that ``check`` and ``report`` write beside the report, by their options."""

from __future__ import annotations

import os
import secrets
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime, timezone
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from grader.report.model.result_model import Result


class JunitFamily(str, Enum):
    """A dialect of JUnit XML, by pytest's name for it."""

    XUNIT2 = "xunit2"
    XUNIT1 = "xunit1"


JunitFile = Annotated[Path | None, typer.Option("--junit", help="Write JUnit XML.")]
JunitFamilyName = Annotated[
    JunitFamily,
    typer.Option(help="xunit2 is valid for Jenkins; xunit1 also has the student's file and line."),
]
MarkdownFile = Annotated[
    Path | None, typer.Option("--markdown", help="Write Markdown, for a comment.")
]
GradescopeFile = Annotated[
    Path | None,
    typer.Option("--gradescope", help="Write Gradescope's results.json, before the run as well."),
]
GradescopeMetadata = Annotated[
    Path | None, typer.Option(help="Gradescope's submission_metadata.json, for its due date.")
]
Github = Annotated[
    bool, typer.Option("--github", help="Tell GitHub Actions: annotations, summary, outputs.")
]
Classroom50 = Annotated[
    bool,
    typer.Option(
        "--classroom50",
        help="Write Classroom 50's result.json and release-body.md here; any grade ends with 0.",
    ),
]


@dataclass(frozen=True)
class Formats:
    """What to write, and where to.

    Attributes:
        gradescope: ``results.json``.
        gradescope_metadata: ``submission_metadata.json``.
        classroom50: Whether Classroom 50 started this.
    """

    junit: Path | None = None
    junit_family: JunitFamily = JunitFamily.XUNIT2
    markdown: Path | None = None
    gradescope: Path | None = None
    gradescope_metadata: Path | None = None
    github: bool = False
    classroom50: bool = False

    @property
    def files(self) -> tuple[Path | None, ...]:
        """What is written by name; None for a format that is not asked for."""
        return (self.junit, self.markdown, self.gradescope)

    @contextmanager
    def grading(self) -> Iterator[None]:
        """While this lasts, what a student's code prints cannot command whoever reads along.

        Raises:
            UsageError: A file cannot be written, or Classroom 50 did not start this.
        """
        # Each is imported only where it is asked for: together they take 0.2 s.
        if self.classroom50:
            from grader.report.formats import classroom50

            classroom50.identity(os.environ)
        if self.gradescope is not None:
            from grader.report.files import write_whole
            from grader.report.formats import gradescope

            write_whole(self.gradescope, gradescope.unfinished())
        if not self.github:
            yield
            return
        from grader.report.formats import github

        token = secrets.token_hex(16)
        print(github.stop_commands(token), flush=True)
        try:
            yield
        finally:
            print(github.resume_commands(token), flush=True)

    def write(self, result: Result, submission: Path | None = None) -> None:
        """Write everything that was asked for.

        Raises:
            UsageError: A file cannot be read or written.
        """
        from grader.report.files import write_whole

        if self.junit is not None:
            from grader.report.formats.junit import render_junit

            xunit1 = self.junit_family is JunitFamily.XUNIT1
            write_whole(self.junit, render_junit(result, xunit1=xunit1))
        if self.markdown is not None:
            from grader.report.formats.markdown import COMMENT_BYTES, render_markdown
            from grader.report.model.student import for_student

            write_whole(self.markdown, render_markdown(for_student(result), COMMENT_BYTES))
        if self.gradescope is not None:
            from grader.report.formats.gradescope import render_gradescope

            metadata = _metadata(self.gradescope_metadata)
            write_whole(self.gradescope, render_gradescope(result, metadata))
        if self.github:
            _tell_github(result, submission, os.environ)
        if self.classroom50:
            _write_classroom50(result, Path())


def _metadata(file: Path | None) -> Mapping[str, Any] | None:
    from grader.report.formats.gradescope import read_metadata

    return read_metadata(file) if file is not None else None


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
        _append(Path(outputs), github.outputs(result, f"rosgrade_{secrets.token_hex(16)}"))


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
        told = UsageError(f"{file} cannot be written: {error.strerror}")
        raise machine_fault(error, file) or told from error


def _write_classroom50(result: Result, folder: Path) -> None:
    from grader.report.files import write_whole
    from grader.report.formats import classroom50

    who = classroom50.identity(os.environ)
    text = classroom50.render_result(result, who, _committed(folder))
    write_whole(folder / classroom50.RESULT_FILE, text)
    write_whole(folder / classroom50.RELEASE_FILE, classroom50.render_release(result))


def _committed(folder: Path) -> str:
    """When the commit that is checked out was made, in UTC; now where there is no commit."""
    try:
        shown = subprocess.run(
            ["git", "show", "--no-patch", "--format=%ct", "HEAD"],
            cwd=folder,
            capture_output=True,
            text=True,
            check=True,
        )
        time = datetime.fromtimestamp(int(shown.stdout), timezone.utc)
    except (OSError, subprocess.CalledProcessError, ValueError):
        time = datetime.now(timezone.utc)
    return time.strftime("%Y-%m-%dT%H:%M:%SZ")
