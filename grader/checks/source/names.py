"""The check of how the code names its classes, functions and fields."""

from __future__ import annotations

import re
from collections.abc import Iterator
from enum import Enum

from pydantic import Field

from grader.checks.check import Subject, check
from grader.checks.source.judged import Share, judged_package, shared, unless_unread
from grader.findings.finding import Finding, Status
from grader.findings.words import listing
from grader.recording.submission import SourceError, SourceFile, SourceFunction, SubmissionRecord


class Style(str, Enum):
    """How a name is written."""

    CAMEL = "CamelCase"
    LOWER_CAMEL = "camelCase"
    SNAKE = "snake_case"
    SNAKE_FIELD = "snake_case_"
    UPPER = "UPPER_CASE"


_FORMS = {
    Style.CAMEL: re.compile(r"[A-Z][A-Za-z0-9]*"),
    Style.LOWER_CAMEL: re.compile(r"[a-z][A-Za-z0-9]*"),
    Style.SNAKE: re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*"),
    Style.SNAKE_FIELD: re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*_"),
    Style.UPPER: re.compile(r"[A-Z][A-Z0-9]*(_[A-Z0-9]+)*"),
}


class Names(Share):
    """Parameters of source.names."""

    classes: tuple[Style, ...] = Field((Style.CAMEL,), description="Styles of classes.")
    functions: tuple[Style, ...] = Field((Style.SNAKE,), description="Styles of functions.")
    fields: tuple[Style, ...] = Field(
        (), description="Styles of fields; none stands for any. ROS 2 writes `snake_case_` in C++."
    )

    def _asked(self) -> str:
        kinds = {"classes": self.classes, "functions": self.functions, "fields": self.fields}
        asked = (
            f"{kind} in {' or '.join(one.value for one in styles)}"
            for kind, styles in kinds.items()
            if styles
        )
        whole = "" if self.share == 1.0 else f", {self.needed} names"
        return f"names of {listing(asked)}{whole}"


@check("source.names", Subject.SUBMISSION, Names)
def names(submission: SubmissionRecord, parameters: Names) -> Finding:
    """Classes, functions and fields are named in the style.

    Judged by the syntax of the package's files in Python and C++. Underscores in front do not
    count. Not judged are constructors, operators, `__names__`, and methods that override another
    one, which have their name from there.
    """
    package, files = judged_package(submission, parameters.package)
    judged = [
        (
            any(_FORMS[style].fullmatch(name.lstrip("_")) for style in styles),
            SourceError(file.path, line, f"{name} is not {' or '.join(s.value for s in styles)}"),
        )
        for file in files
        for styles, name, line in _named(file, parameters)
        if styles
    ]
    found = shared(parameters, judged, "such a name", "other_style")
    if found.status is Status.PASSED:
        return found
    return unless_unread(submission, package, found)


def _named(file: SourceFile, parameters: Names) -> Iterator[tuple[tuple[Style, ...], str, int]]:
    for one in file.classes:
        yield parameters.classes, one.short, one.line
        yield from ((parameters.fields, name, line) for name, line in one.fields)
    owners = {one.short for one in file.classes}
    for function in file.functions:
        if _chooses_its_name(function, owners):
            yield parameters.functions, function.short, function.line


def _chooses_its_name(function: SourceFunction, classes: set[str]) -> bool:
    name = function.short
    owner = function.name.removesuffix(name).rstrip(".:").replace("::", ".").rpartition(".")[2]
    is_special = name.startswith(("__", "~", "operator")) or name in (owner, *classes)
    return not is_special and not function.overriding
