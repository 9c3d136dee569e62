"""The check of what the code must not use."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Annotated

from pydantic import AfterValidator, Field

from grader.checks.check import Subject, check
from grader.checks.package.package import OfPackage
from grader.checks.source.judged import MOST_PLACES, judged_package
from grader.diagnosis.explanation import mistaken
from grader.findings.finding import Evidence, Finding
from grader.findings.words import codes, counted
from grader.recording.submission import SourceError, SourceFile, SubmissionRecord

_CONSTRUCTS = ("using namespace", "goto", "new", "delete", "#define", "global", "import *")
_NAME = re.compile(r"[A-Za-z_]\w*((\.|::)[A-Za-z_]\w*)*")


def _construct(text: str) -> str:
    name = text.removeprefix("using namespace ")
    if text not in _CONSTRUCTS and not _NAME.fullmatch(name):
        known = ", ".join(map(repr, _CONSTRUCTS))
        raise ValueError(
            f"{text!r} is neither the name of a function nor one of {known}, 'using namespace std'"
        )
    return text


class Avoids(OfPackage):
    """Parameters of source.avoids."""

    constructs: tuple[Annotated[str, AfterValidator(_construct)], ...] = Field(
        min_length=1,
        description="What must not be there: a function (`time.sleep`, `system`, "
        "`std::this_thread::sleep_for`), `using namespace std`, any `using namespace`, `goto`, "
        "`new`, `delete`, `#define` of a value, `global`, `import *`.",
    )

    def _asked(self) -> str:
        return f"no {codes(self.constructs)} in the code"


@check("source.avoids", Subject.SUBMISSION, Avoids)
def avoids(submission: SubmissionRecord, parameters: Avoids) -> Finding:
    """The code does without what it must not use.

    Judged by the syntax of the package's files in Python and C++: comments and texts do not count.
    A function counts where it is called, by its whole name, after an import or `using` of it, or
    as a method of anything (`create_rate` finds `self.create_rate()`).
    """
    _, files = judged_package(submission, parameters.package)
    places = [
        SourceError(file.path, line, construct)
        for file in files
        for construct in parameters.constructs
        for line in sorted(set(_lines(file, construct)))
    ]
    if not places:
        return Finding.as_asked("none")
    found = codes(dict.fromkeys(place.message for place in places))
    seen = f"{counted(len(places), 'place')} with {found}, the first at {places[0]}"
    return mistaken("avoided", seen, Evidence(places=tuple(places[:MOST_PLACES])), names=found)


def _lines(file: SourceFile, construct: str) -> Iterator[int]:
    """Where a file has a construct."""
    for found, line in file.constructs:
        if found == construct or found.startswith(f"{construct} "):
            yield line
    if construct in _CONSTRUCTS:
        return
    names = dict(file.names)
    separator = "::" if "::" in construct else "."
    for call in file.calls:
        first, *others = re.split(r"(\.|::)", call.name, maxsplit=1)
        whole = names.get(first, first) + "".join(others)
        meant = {call.name, whole, *(f"{star}{separator}{call.name}" for star in file.stars)}
        if any(re.search(rf"(^|\.|::){re.escape(construct)}$", name) for name in meant):
            yield call.line
