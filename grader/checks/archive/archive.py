"""Checks of the files of a submission: leftovers of builds, texts."""

from __future__ import annotations

from fnmatch import fnmatch

from pydantic import Field

from grader.checks.check import Parameters, Subject, check
from grader.diagnosis.cause import Cause
from grader.findings.finding import Finding
from grader.findings.wording import code, codes, listing
from grader.submission.record import SubmissionRecord


class Clean(Parameters):
    """Parameters of archive.clean."""

    asks = "nothing that a build or a run makes, such as `build` or `__pycache__`"


@check("archive.clean", Subject.SUBMISSION, Clean)
def clean(submission: SubmissionRecord, parameters: Clean) -> Finding | Cause:
    """The submission holds nothing that a build or a run makes.

    That is `build`, `install` and `log` of colcon, `CMakeFiles`, `__pycache__`, `*.pyc`,
    `*.egg-info`, virtual environments and caches of tools. A folder is judged as it is, and so is a
    workspace in which you have just built.
    """
    if not submission.leftovers:
        return Finding.passed(parameters.asked_for, "there is nothing of that kind")
    return Cause(
        f"it holds {codes(submission.leftovers)}",
        "Hand in the sources only. `git archive HEAD -o handin.zip` packs what is committed; put "
        f"{codes(sorted({one.rpartition('/')[2] for one in submission.leftovers}))} into "
        "`.gitignore`.",
    )


class File(Parameters):
    """Parameters of archive.file."""

    path: str = Field(
        min_length=1,
        description="Path in the submission, or a file name in any folder; `*` and `?` stand for "
        "any text and any character, as in `README*`. Lower and upper case are the same.",
    )
    headings: tuple[str, ...] = Field(
        (), description="Words that headings of the text must contain, one heading for each."
    )

    def _asked(self) -> str:
        words = listing(f'"{heading}"' for heading in self.headings)
        return f"a file {code(self.path)}" + (f" with the headings {words}" if words else "")

    def matches(self, path: str) -> bool:
        """Whether a path is meant."""
        pattern = self.path.lower()
        return any(fnmatch(one.lower(), pattern) for one in (path, path.rpartition("/")[2]))


@check("archive.file", Subject.SUBMISSION, File)
def file(submission: SubmissionRecord, parameters: File) -> Finding | Cause:
    """The submission holds the file, with the expected headings.

    Headings are those of Markdown (`# Usage`, or underlined with `===` or `---`) and of
    reStructuredText. One text must hold all of them.
    """
    found = [path for path in submission.files if parameters.matches(path)]
    if not found:
        return Cause(
            "there is no such file", f"Add the file {code(parameters.path)} to what you hand in."
        )
    texts = dict(submission.headings)
    missing = min((_missing(parameters, texts.get(path, ())) for path in found), key=len)
    if not missing:
        return Finding.passed(parameters.asked_for, f"found {codes(found)}")
    headings = [heading for path in found for heading in texts.get(path, ())]
    there = listing(f'"{heading}"' for heading in headings) or "none"
    wanted = listing(f'"{heading}"' for heading in missing)
    return Cause(
        f"{codes(found)} lacks {wanted}; its headings: {there}",
        f"Write a section with the heading `# {missing[0]}`.",
    )


def _missing(parameters: File, headings: tuple[str, ...]) -> list[str]:
    return [
        wanted
        for wanted in parameters.headings
        if not any(wanted.casefold() in heading.casefold() for heading in headings)
    ]
