"""Checks of the source as handed in: its classes, docstrings, type hints, prints, style.

All of them judge facts that were read from syntax trees; nothing of the student's is imported.
Tests, launch files, setup.py and conftest.py are left aside.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, field_validator

from grader.checks.check import Subject, check, stop_if
from grader.checks.need import RuffRules, Submitted
from grader.checks.package.package import OfPackage
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.not_built import existing_package, why_no_package, why_too_new
from grader.findings.finding import Evidence, Finding
from grader.findings.words import code, codes, counted, listing, percent
from grader.recording.submission import (
    PYTHON,
    PackageRecord,
    SourceError,
    SourceFile,
    SourceFunction,
    SubmissionRecord,
)
from grader.spec.nearest_name import nearest
from grader.spec.quantity import Ratio
from grader.submission.read.inheritance import NODE, Family, FoundClass
from grader.submission.read.lint import EXCLUDED

_MOST_PLACES = 20
_DOTTED = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)+")
_RULE = re.compile(r"[A-Z]+[0-9]*")


class OfPython(OfPackage):
    """Part of the parameters of every check of the source."""

    only = PYTHON


def _judged_package(submission: SubmissionRecord, name: str) -> PackageRecord:
    """The package with its Python files; ends the check if they cannot be judged."""
    stop_if(why_no_package(submission, name))
    package = existing_package(submission, name)
    stop_if(why_too_new(package))
    if package.syntax_errors:
        seen = f"Python cannot read {package.syntax_errors[0]}"
        places = package.syntax_errors[:_MOST_PLACES]
        stop_if(mistaken("unreadable", seen, Evidence(places=places)))
    if not package.sources:
        seen = f"the package {code(name)} has no Python code"
        stop_if(mistaken("no_python", seen, folder=code(f"{name}/{name}")))
    return package


def _dotted_name(text: str) -> str:
    if not _DOTTED.fullmatch(text):
        raise ValueError(f"{text!r} is not a class with its module, such as {NODE!r}")
    return text


class Class(OfPython):
    """Parameters of source.class."""

    name: str | None = Field(None, description="Name of the class; by default any.")
    inherits: Annotated[str, AfterValidator(_dotted_name)] = Field(
        NODE, description="Class that it inherits, with its module."
    )

    def _asked(self) -> str:
        what = f"the class {code(self.name)}" if self.name else "a class"
        return f"{what} that inherits {code(self.inherits.rpartition('.')[2])}"


@check("source.class", Subject.SUBMISSION, Class)
def class_(submission: SubmissionRecord, parameters: Class) -> Finding:
    """The class is there and inherits Node.

    Judged by the syntax of the package's Python files. It does not matter how the base class is
    imported or called (`rclpy.node.Node`, `import ... as`, an alias), and whether it is inherited
    directly or through another class in any file. A lifecycle node is a node.
    """
    package = _judged_package(submission, parameters.package)
    family = Family([file for other in submission.packages for file in other.sources])
    classes = [item for item in family.classes if item.file in package.sources]
    named = [item for item in classes if parameters.name in (None, _short(item))]
    kin = [item for item in named if family.inherits(item, parameters.inherits)]
    if not kin:
        stop_if(_why_no_class(family, classes, named, parameters))
    place = _place(kin[0], f"class {kin[0].found.name}")
    observed = f"{codes(item.found.name for item in kin)} ({place.file}:{place.line})"
    return Finding.as_asked(observed, Evidence(places=(place,)))


def _why_no_class(
    family: Family, classes: Sequence[FoundClass], named: Sequence[FoundClass], parameters: Class
) -> Finding:
    module, _, base = parameters.inherits.rpartition(".")
    name = parameters.name or "MyClass"
    write = f"from {module} import {base}", f"class {name}({base}):"
    if not classes:
        return mistaken("no_class", "no class is defined in the package", write=codes(write))
    evidence = Evidence(places=tuple(_place(item, _inherits(item)) for item in classes[:10]))
    if not named:
        there = sorted({_short(item) for item in classes})
        match = nearest(name, there)
        found = f"found the class {code(match)}" if match else f"found {codes(there)} only"
        return mistaken("other_class", found, evidence, name=code(name))
    for item in named:
        foreign = family.foreign(item)
        if foreign:
            seen = f"{code(item.found.name)} inherits {codes(foreign)}, which was not handed in"
            hint = "A person has to look at the class: the source of its base class is needed."
            return Finding.ours(seen, hint)
    place = _place(named[0], "")
    seen = "; ".join(_inherits(item) for item in named[:4])
    return mistaken("no_class", f"{seen} ({place.file}:{place.line})", evidence, write=codes(write))


def _inherits(item: FoundClass) -> str:
    return f"{code(item.found.name)} inherits {codes(item.found.bases) or 'nothing'}"


def _short(item: FoundClass) -> str:
    return item.found.name.rpartition(".")[2]


def _place(item: FoundClass, message: str) -> SourceError:
    return SourceError(item.file.path, item.found.line, message)


class _Share(OfPython):
    """Part of the parameters of source.docstrings and source.type_hints."""

    share: Ratio = Field(1.0, description="Share of them that must have one.")

    @field_validator("share")
    @classmethod
    def _possible(cls, share: float) -> float:
        if not 0.0 < share <= 1.0:
            raise ValueError("the share must be more than 0 % and at most 100 %")
        return share

    @property
    def needed(self) -> str:
        """The share in words."""
        return "all" if self.share == 1.0 else f"at least {percent(self.share)} of the"


_PLURALS = {"module": "modules", "class": "classes", "function": "functions"}


class Docstrings(_Share):
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
    """Classes and functions have docstrings.

    Judged by the syntax of the package's Python files. Names that begin with an underscore need
    none, `__init__` included, nor do functions inside of functions, overloads, setters, and an
    empty `__init__.py`.
    """
    package = _judged_package(submission, parameters.package)
    judged = [
        (documented, SourceError(file.path, line, text))
        for file in package.sources
        for kind, documented, line, text in _documentable(file)
        if kind in parameters.of
    ]
    return _shared(parameters, judged, "a docstring", "no_docstring")


def _documentable(file: SourceFile) -> Iterator[tuple[str, bool, int, str]]:
    """What should have a docstring: its kind, whether it has one, its line, and words for it."""
    if file.classes or file.functions or file.names or file.stars or file.prints:
        yield "module", file.documented, 1, "the module"
    for one in file.classes:
        if _is_public(one.name):
            yield "class", one.documented, one.line, f"the class {one.name}"
    for function in file.functions:
        decorators = {name.rpartition(".")[2] for name in function.decorators}
        if _is_public(function.name) and not decorators & {"overload", "setter", "deleter"}:
            yield "function", function.documented, function.line, f"{function.name}()"


def _is_public(name: str) -> bool:
    parts = name.split(".")
    return "<locals>" not in parts and not any(part.startswith("_") for part in parts)


class TypeHints(_Share):
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
    package = _judged_package(submission, parameters.package)
    judged = [
        (not lacking, SourceError(file.path, one.line, f"{one.name}(): {lacking}"))
        for file in package.sources
        for one in file.functions
        for lacking in [_lacking(one, parameters.returns)]
    ]
    return _shared(parameters, judged, "every hint", "no_type_hint")


def _lacking(one: SourceFunction, returns: bool) -> str:
    missing = codes(one.unannotated)
    init = one.name.rpartition(".")[2] in ("__init__", "__post_init__")
    if returns and not one.returns and not init:
        missing = f"{missing} and what it returns" if missing else "what it returns"
    return f"no hint for {missing}" if missing else ""


def _shared(
    parameters: _Share, judged: Sequence[tuple[bool, SourceError]], what: str, mistake: str
) -> Finding:
    """The finding by the share of items that have what they need."""
    lacking = [place for good, place in judged if not good]
    having = len(judged) - len(lacking)
    observed = f"{having} of {len(judged)} have {what}"
    # The small amount is float noise of the product.
    if judged and having >= parameters.share * len(judged) - 1e-9:
        return Finding.as_asked(observed)
    first = f"the first without is {lacking[0]}" if lacking else "there is nothing to judge"
    shown = Evidence(places=tuple(lacking[:_MOST_PLACES]))
    return mistaken(mistake, f"{observed}; {first}", shown)


class NoPrint(OfPython):
    """Parameters of source.no_print."""

    asks = "no print(): the node's logger tells what happens"


@check("source.no_print", Subject.SUBMISSION, NoPrint)
def no_print(submission: SubmissionRecord, parameters: NoPrint) -> Finding:
    """The code does not call print(): the node logs.

    Judged by the syntax of the package's Python files: `print` is neither called nor passed as a
    function. Printing to a file is allowed.
    """
    package = _judged_package(submission, parameters.package)
    places = [
        SourceError(file.path, line, "print") for file in package.sources for line in file.prints
    ]
    if not places:
        return Finding.as_asked("no print()")
    number = counted(len(places), "place")
    seen = f"{number} with print(), the first at {places[0].file}:{places[0].line}"
    return mistaken("prints", seen, Evidence(places=tuple(places[:_MOST_PLACES])))


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
    lint = _judged_package(submission, parameters.package).lint
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
        Evidence(places=tuple(places[:_MOST_PLACES])),
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
