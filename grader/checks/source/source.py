"""Checks of the source as handed in: docstrings, type hints, prints, style.

All of them judge facts that were read from syntax trees; nothing of the student's is imported.
Tests, launch files, setup.py and conftest.py are left aside.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Annotated, Literal, NamedTuple

from pydantic import AfterValidator, Field

from grader.checks.check import Subject, check
from grader.checks.need import RuffRules, Submitted
from grader.checks.package.package import OfPackage
from grader.checks.source.judged import (
    MOST_PLACES,
    OfPython,
    Share,
    judged_package,
    shared,
    unless_unread,
)
from grader.diagnosis.explanation import mistaken
from grader.findings.finding import Evidence, Finding, Status
from grader.findings.words import codes, counted, listing, worded
from grader.recording.submission import (
    CPP,
    PYTHON,
    SourceError,
    SourceFile,
    SourceFunction,
    SubmissionRecord,
)
from grader.submission.read.lint import EXCLUDED

_RULE = re.compile(r"[A-Z]+[0-9]*")
_PLURALS = {"module": "modules", "class": "classes", "function": "functions"}


class Docstrings(Share):
    """Parameters of source.docstrings."""

    of: tuple[Literal["module", "class", "function"], ...] = Field(
        ("class", "function"),
        min_length=1,
        description="What needs one: `module`, `class`, `function` (with methods).",
    )

    def _asked(self) -> str:
        return f"docstrings of {self.needed} {listing(_PLURALS[kind] for kind in self.of)}"


@check("source.docstrings", Subject.SUBMISSION, Docstrings)
def docstrings(submission: SubmissionRecord, parameters: Docstrings) -> Finding:
    """Classes and functions have docstrings, or comments for Doxygen.

    Judged by the syntax of the package's files. In Python, names that begin with an underscore need
    no docstring, `__init__` included, nor do functions inside of functions, overloads, setters, and
    an empty `__init__.py`. In C++, a comment for Doxygen (`/** */`, `///`) stands before the
    declaration or the definition. What is private or protected, constructors, destructors,
    operators, and methods with `override` need none.
    """
    package, files = judged_package(submission, parameters.package)
    items = [item for file in files for item in _documentable_python(file)]
    items += _documentable_cpp([file for file in files if file.language == CPP])
    judged = [(item.documented, item.place) for item in items if item.kind in parameters.of]
    what = worded(python="a docstring", cpp="a comment for Doxygen")
    found = shared(parameters, judged, what, "no_docstring")
    return found if found.status is Status.PASSED else unless_unread(submission, package, found)


class _Item(NamedTuple):
    """What should have a docstring: a module, a class or a function."""

    kind: str
    documented: bool
    place: SourceError


def _documentable_python(file: SourceFile) -> Iterator[_Item]:
    if file.language == CPP:
        return
    if file.classes or file.functions or file.names or file.stars or file.prints:
        yield _Item("module", file.documented, SourceError(file.path, 1, "the module"))
    for class_ in file.classes:
        if _is_public(class_.name):
            place = SourceError(file.path, class_.line, f"the class {class_.name}")
            yield _Item("class", class_.documented, place)
    for function in file.functions:
        decorators = {name.rpartition(".")[2] for name in function.decorators}
        if _is_public(function.name) and not decorators & {"overload", "setter", "deleter"}:
            place = SourceError(file.path, function.line, f"{function.name}()")
            yield _Item("function", function.documented, place)


def _documentable_cpp(files: Sequence[SourceFile]) -> Iterator[_Item]:
    """The same of C++, where a declaration and a definition may be in two files."""
    by_name: dict[str, list[tuple[SourceFile, SourceFunction]]] = {}
    for file in files:
        for class_ in file.classes:
            if "<locals>" not in class_.name:
                place = SourceError(file.path, class_.line, f"the class {class_.name}")
                yield _Item("class", class_.documented, place)
        for function in file.functions:
            # With its class: the namespace may be left out where it is defined.
            name = "::".join(function.name.split("::")[-2:])
            by_name.setdefault(name, []).append((file, function))
    classes = {class_.short for file in files for class_ in file.classes}
    for name, places in by_name.items():
        file, first = places[0]
        functions = [function for _, function in places]
        is_special = first.short in classes or first.short.startswith(("~", "operator"))
        if is_special or "<locals>" in first.name or any(one.overriding for one in functions):
            continue
        if all(one.public for one in functions):
            documented = any(one.documented for one in functions)
            yield _Item("function", documented, SourceError(file.path, first.line, f"{name}()"))


def _is_public(name: str) -> bool:
    parts = name.split(".")
    return "<locals>" not in parts and not any(part.startswith("_") for part in parts)


class TypeHints(Share, OfPython):
    """Parameters of source.type_hints."""

    returns: bool = Field(True, description="Whether return values need a hint too.")

    def _asked(self) -> str:
        what = "parameters and return types" if self.returns else "parameters"
        return f"type hints for the {what} of {self.needed} functions"


@check("source.type_hints", Subject.SUBMISSION, TypeHints)
def type_hints(submission: SubmissionRecord, parameters: TypeHints) -> Finding:
    """Functions have type hints.

    Judged by the syntax of the package's Python files: every parameter and every return value.
    `self`, `cls`, the return value of `__init__` and lambdas need no hint.
    """
    _, files = judged_package(submission, parameters.package, (PYTHON,))
    judged = [
        (not lacking, SourceError(file.path, one.line, f"{one.name}(): {lacking}"))
        for file in files
        for one in file.functions
        for lacking in [_lacking(one, parameters.returns)]
    ]
    return shared(parameters, judged, "every hint", "no_type_hint")


def _lacking(one: SourceFunction, returns: bool) -> str:
    missing = codes(one.unannotated)
    init = one.name.rpartition(".")[2] in ("__init__", "__post_init__")
    if returns and not one.returns and not init:
        missing = f"{missing} and what it returns" if missing else "what it returns"
    return f"no hint for {missing}" if missing else ""


class NoPrint(OfPackage):
    """Parameters of source.no_print."""

    asks = "nothing is printed: the node's logger tells what happens"


@check("source.no_print", Subject.SUBMISSION, NoPrint)
def no_print(submission: SubmissionRecord, parameters: NoPrint) -> Finding:
    """The code does not print: the node logs.

    Judged by the syntax of the package's files. In Python, `print` is neither called nor passed as
    a function. In C++, nothing is written to `std::cout`, `std::cerr`, `std::clog` or by `printf()`
    and the like. Printing to a file is allowed.
    """
    _, files = judged_package(submission, parameters.package)
    places = [SourceError(file.path, line, "print") for file in files for line in file.prints]
    what = worded(python="print()", cpp="std::cout, printf() or the like")
    if not places:
        return Finding.as_asked(f"no {what}")
    number = counted(len(places), "place")
    seen = f"{number} with {what}, the first at {places[0].file}:{places[0].line}"
    return mistaken("prints", seen, Evidence(places=tuple(places[:MOST_PLACES])))


def _rule(text: str) -> str:
    if not _RULE.fullmatch(text):
        raise ValueError(f"{text!r} is not a rule of ruff: write 'F401', or 'E' for a group")
    if text in EXCLUDED:
        raise ValueError(f"ruff has either {text} or {EXCLUDED[text]}: write {EXCLUDED[text]}")
    return text


class Ruff(OfPython):
    """Parameters of source.ruff."""

    needs = (Submitted(), RuffRules())

    rules: tuple[Annotated[str, AfterValidator(_rule)], ...] = Field(
        min_length=1,
        description="Codes of ruff's rules: `F401`, or `F` for a whole group. See "
        "https://docs.astral.sh/ruff/rules/.",
    )
    except_: tuple[Annotated[str, AfterValidator(_rule)], ...] = Field(
        (), alias="except", description="Rules of these groups that do not matter."
    )
    at_most: int = Field(
        0, ge=0, description="Number of places that may break a rule, at most 19.", le=19
    )

    def _asked(self) -> str:
        but = f" but {', '.join(self.except_)}" if self.except_ else ""
        most = f"at most {self.at_most}" if self.at_most else "no"
        return f"{most} places that break ruff's rules {', '.join(self.rules)}{but}"

    def is_broken_by(self, found: str) -> bool:
        """Whether a code of ruff is among the rules."""
        return any(_covers(rule, found) for rule in self.rules) and not any(
            _covers(rule, found) for rule in self.except_
        )


@check("source.ruff", Subject.SUBMISSION, Ruff)
def ruff(submission: SubmissionRecord, parameters: Ruff) -> Finding:
    """The code follows the given rules of ruff.

    Judged by `ruff check` on the package's Python files, with lines of up to 99 characters as in
    the style guide of ROS 2, without the student's configuration and `# noqa`. If the machine that
    grades lacks ruff, the check ends as an error and costs no points.
    """
    lint = judged_package(submission, parameters.package, (PYTHON,))[0].lint
    if lint is None or lint.problem is not None:
        why = "ruff was not asked" if lint is None else lint.problem
        return Finding.ours(f"the style was not looked at: {why}")
    found = [item for item in lint.findings if parameters.is_broken_by(item.code)]
    if len(found) <= parameters.at_most:
        observed = counted(len(found), "place") if found else "none"
        return Finding.as_asked(observed)
    places = [SourceError(item.file, item.line, f"{item.code} {item.message}") for item in found]
    return mistaken(
        "breaks_rule",
        f"{counted(len(places), 'place')}, the first at {places[0]}",
        Evidence(places=tuple(places[:MOST_PLACES])),
        rules=",".join(parameters.rules),
        rule=found[0].code,
    )


def _covers(rule: str, found: str) -> bool:
    """Whether a rule is, or a group holds, what ruff found: `E` holds E501, but not ERA001."""
    if not rule.isalpha():
        return found.startswith(rule)
    letters = found.rstrip("0123456789")
    # pylint's rules are four groups, PLC to PLW, and one.
    return letters == rule or (rule == "PL" and letters[:2] == "PL")
