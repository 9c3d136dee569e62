"""Checks of the source as handed in: its classes, docstrings, type hints, prints, style.

All of them judge facts that were read from syntax trees; nothing of the student's is imported.
Tests, launch files, setup.py and conftest.py are left aside.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Annotated, ClassVar, Literal

from pydantic import AfterValidator, Field, field_validator

from grader.checks.check import Parameters, Subject, check
from grader.checks.finding import Evidence, Finding
from grader.checks.need import Need, RuffRules, Submitted
from grader.checks.source.inheritance import NODE, Family, FoundClass, Kinship
from grader.checks.wording import code, codes, counted, percent
from grader.diagnosis.cause import Cause
from grader.diagnosis.not_built import existing_package, why_no_package, why_too_new
from grader.spec.name import PackageName
from grader.spec.nearest_name import nearest
from grader.spec.quantity import Ratio
from grader.submission.read.code_facts import LintFinding, SourceFile, SourceFunction
from grader.submission.read.lint import EXCLUDED
from grader.submission.record import PackageRecord, SourceError, SubmissionRecord

_MOST_PLACES = 20
_DOTTED = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)+")
_RULE = re.compile(r"[A-Z]+[0-9]*")


class Source(Parameters):
    """Parameters of source.no_print, and part of those of the other checks of the source."""

    needs: ClassVar[tuple[Need, ...]] = (Submitted(),)

    package: PackageName = Field(description="Name in package.xml.")


def _python_files(submission: SubmissionRecord, name: str) -> PackageRecord | Cause:
    """The package with its Python files, or why they cannot be judged."""
    cause = why_no_package(submission, name)
    if cause is not None:
        return cause
    package = existing_package(submission, name)
    newer = why_too_new(package)
    if newer is not None:
        return newer
    if package.syntax_errors:
        return Cause(
            f"Python cannot read {package.syntax_errors[0]}",
            "Correct this line or the one before it.",
            Evidence(places=package.syntax_errors[:_MOST_PLACES]),
        )
    if not package.sources:
        return Cause(
            f"the package {code(name)} has no Python code",
            f"The code belongs into the folder {code(f'{name}/{name}')}, beside __init__.py.",
        )
    return package


def _dotted_name(text: str) -> str:
    if not _DOTTED.fullmatch(text):
        raise ValueError(f"{text!r} is not a class with its module, such as {NODE!r}")
    return text


class Class(Source):
    """Parameters of source.class."""

    name: str | None = Field(None, description="Name of the class; by default any.")
    inherits: Annotated[str, AfterValidator(_dotted_name)] = Field(
        NODE, description="Class that it inherits, with its module."
    )


@check("source.class", Subject.SUBMISSION, Class)
def class_(submission: SubmissionRecord, parameters: Class) -> Finding:
    """The class is there and inherits Node.

    Judged by the syntax of the package's Python files. It does not matter how the base class is
    imported or called (`rclpy.node.Node`, `import ... as`, an alias), and whether it is
    inherited at once or through a class of your own, in any file. A lifecycle node is a node.
    """
    base = parameters.inherits.rpartition(".")[2]
    who = f"the class {code(parameters.name)}" if parameters.name else "a class"
    expected = f"{who} that inherits {code(base)}"
    package = _python_files(submission, parameters.package)
    if isinstance(package, Cause):
        return package.finding(expected)
    family = Family([file for other in submission.packages for file in other.sources])
    own = {file.path for file in package.sources}
    classes = [item for item in family.classes if item.file.path in own]
    named = [item for item in classes if parameters.name in (None, _short(item))]
    kin = [item for item in named if family.inherits(item, parameters.inherits) is Kinship.YES]
    if kin:
        place = _place(kin[0], f"class {kin[0].found.name}")
        return Finding.passed(
            expected,
            f"{codes(item.found.name for item in kin)} ({place.file}:{place.line})",
            Evidence(places=(place,)),
        )
    return _why_no_class(family, classes, named, parameters).finding(expected)


def _why_no_class(
    family: Family, classes: Sequence[FoundClass], named: Sequence[FoundClass], parameters: Class
) -> Cause:
    base = parameters.inherits.rpartition(".")[2]
    module = parameters.inherits.rpartition(".")[0]
    hint = (
        f"Write `from {module} import {base}` and `class {parameters.name or 'MyClass'}({base}):`."
    )
    if not classes:
        return Cause("no class is defined in the package", hint)
    evidence = Evidence(places=tuple(_place(item, _inherits(item)) for item in classes[:10]))
    if not named:
        there = sorted({_short(item) for item in classes})
        match = nearest(str(parameters.name), there)
        found = f"found the class {code(match)}" if match else f"found {codes(there)} only"
        return Cause(found, f"Call the class {code(str(parameters.name))}.", evidence)
    unknown = [
        item for item in named if family.inherits(item, parameters.inherits) is Kinship.UNKNOWN
    ]
    if unknown:
        return Cause(
            f"{code(unknown[0].found.name)} inherits {codes(family.foreign(unknown[0]))}, which "
            "was not handed in, so it cannot be told whether that is a node",
            "Somebody has to look at the class; the source of its base class is needed.",
            ours=True,
        )
    if parameters.name is None:
        seen = f"none of {counted(len(named), 'class', 'classes')} inherits {code(base)}: " + (
            "; ".join(_inherits(item) for item in named[:4])
        )
    else:
        place = _place(named[0], "")
        seen = f"{_inherits(named[0])} ({place.file}:{place.line})"
    return Cause(seen, hint, evidence)


def _inherits(item: FoundClass) -> str:
    bases = codes(item.found.bases) or "nothing"
    return f"{code(item.found.name)} inherits {bases}"


def _short(item: FoundClass) -> str:
    return item.found.name.rpartition(".")[2]


def _place(item: FoundClass, message: str) -> SourceError:
    return SourceError(item.file.path, item.found.line, message)


class _Share(Source):
    """Part of the parameters of source.docstrings and source.type_hints."""

    share: Ratio = Field(
        1.0,
        description="Share of them that must have one, by default 100 %.",
        validate_default=False,
    )

    @field_validator("share")
    @classmethod
    def _possible(cls, share: float) -> float:
        if not 0.0 < share <= 1.0:
            raise ValueError("the share must be more than 0 % and at most 100 %")
        return share


Documented = Literal["module", "class", "function"]


class Docstrings(_Share):
    """Parameters of source.docstrings."""

    of: tuple[Documented, ...] = Field(
        ("class", "function"),
        min_length=1,
        description="What needs one: `module`, `class`, `function` (with methods).",
    )


@check("source.docstrings", Subject.SUBMISSION, Docstrings)
def docstrings(submission: SubmissionRecord, parameters: Docstrings) -> Finding:
    """Classes and functions have docstrings.

    Judged by the syntax of the package's Python files. Names that begin with an underscore need
    none, `__init__` included, nor do functions inside of functions, overloads, setters, and an
    empty `__init__.py`.
    """
    expected = f"docstrings of {_needed(parameters.share)} {_plurals(parameters.of)}"
    package = _python_files(submission, parameters.package)
    if isinstance(package, Cause):
        return package.finding(expected)
    judged: list[tuple[bool, SourceError]] = []
    for file in package.sources:
        if "module" in parameters.of and not _is_empty(file):
            judged.append((file.documented, SourceError(file.path, 1, "the module")))
        if "class" in parameters.of:
            judged += [
                (one.documented, SourceError(file.path, one.line, f"the class {one.name}"))
                for one in file.classes
                if _is_public(one.name)
            ]
        if "function" in parameters.of:
            judged += [
                (one.documented, SourceError(file.path, one.line, f"{one.name}()"))
                for one in file.functions
                if _is_public(one.name) and not _is_overload(one) and not _is_setter(one)
            ]
    return _shared(
        expected,
        parameters.share,
        judged,
        "a docstring",
        'A docstring is the first statement in the body: """Publish the next command.""" A '
        "comment with # is none.",
    )


def _is_empty(file: SourceFile) -> bool:
    return not (file.classes or file.functions or file.names or file.stars or file.prints)


def _is_public(name: str) -> bool:
    parts = name.split(".")
    return "<locals>" not in parts and not any(part.startswith("_") for part in parts)


def _is_overload(one: SourceFunction) -> bool:
    return any(name.rpartition(".")[2] == "overload" for name in one.decorators)


def _is_setter(one: SourceFunction) -> bool:
    return any(name.rpartition(".")[2] in ("setter", "deleter") for name in one.decorators)


def _plurals(kinds: Iterable[str]) -> str:
    words = {"module": "modules", "class": "classes", "function": "functions"}
    return " and ".join(words[kind] for kind in dict.fromkeys(kinds))


def _needed(share: float) -> str:
    return "all" if share == 1.0 else f"at least {percent(share)} of the"


class TypeHints(_Share):
    """Parameters of source.type_hints."""

    returns: bool = Field(True, description="Whether what a function returns needs a hint too.")


@check("source.type_hints", Subject.SUBMISSION, TypeHints)
def type_hints(submission: SubmissionRecord, parameters: TypeHints) -> Finding:
    """Functions have type hints.

    Judged by the syntax of the package's Python files: every parameter, and what is returned.
    `self` and `cls` need no hint, nor does what `__init__` returns, nor a lambda.
    """
    what = "parameters and return types" if parameters.returns else "parameters"
    expected = f"type hints for the {what} of {_needed(parameters.share)} functions"
    package = _python_files(submission, parameters.package)
    if isinstance(package, Cause):
        return package.finding(expected)
    judged = [
        (not lacking, SourceError(file.path, one.line, f"{one.name}(): {lacking}"))
        for file in package.sources
        for one in file.functions
        for lacking in [_lacking(one, parameters.returns)]
    ]
    return _shared(
        expected,
        parameters.share,
        judged,
        "every hint",
        "Write the types behind the names: `def callback(self, msg: Twist) -> None:`.",
    )


def _lacking(one: SourceFunction, returns: bool) -> str:
    missing = codes(one.unannotated)
    init = one.name.rpartition(".")[2] in ("__init__", "__post_init__")
    if returns and not one.returns and not init:
        missing = f"{missing} and what it returns" if missing else "what it returns"
    return f"no hint for {missing}" if missing else ""


def _shared(
    expected: str, share: float, judged: Sequence[tuple[bool, SourceError]], what: str, hint: str
) -> Finding:
    """Judge by how many have what they need."""
    lacking = [place for good, place in judged if not good]
    having = len(judged) - len(lacking)
    if not judged:
        return Finding.failed(expected, "there is none of these in the package", hint)
    # The small amount is float noise of the product.
    if having >= share * len(judged) - 1e-9:
        return Finding.passed(expected, f"{having} of {len(judged)} have {what}")
    first = lacking[0]
    return Finding.failed(
        expected,
        f"{having} of {len(judged)} have {what}; the first without is {first}",
        hint,
        Evidence(places=tuple(lacking[:_MOST_PLACES])),
    )


@check("source.no_print", Subject.SUBMISSION, Source)
def no_print(submission: SubmissionRecord, parameters: Source) -> Finding:
    """Nothing is printed: the node logs.

    Judged by the syntax of the package's Python files: `print` is not called, nor handed on as
    a function. Printing into a file is not meant.
    """
    expected = "no print(): the node's logger tells what happens"
    package = _python_files(submission, parameters.package)
    if isinstance(package, Cause):
        return package.finding(expected)
    places = [
        SourceError(file.path, line, "print") for file in package.sources for line in file.prints
    ]
    if not places:
        return Finding.passed(expected, "no print()")
    return Finding.failed(
        expected,
        f"{counted(len(places), 'place')} with print(), the first at "
        f"{places[0].file}:{places[0].line}",
        "Write self.get_logger().info('...'): it has a level and the node's name, and goes to "
        "/rosout as well.",
        Evidence(places=tuple(places[:_MOST_PLACES])),
    )


def _rule(text: str) -> str:
    if not _RULE.fullmatch(text):
        raise ValueError(f"{text!r} is not a rule of ruff: write 'F401', or 'E' for a group")
    if text in EXCLUDED:
        raise ValueError(f"ruff has either {text} or {EXCLUDED[text]}: write {EXCLUDED[text]}")
    return text


class Ruff(Source):
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
    at_most: int = Field(0, ge=0, description="Places that may break a rule, at most 19.", le=19)


@check("source.ruff", Subject.SUBMISSION, Ruff)
def ruff(submission: SubmissionRecord, parameters: Ruff) -> Finding:
    """The code keeps the rules of ruff that are named.

    Judged by `ruff check` on the package's Python files, with lines of up to 99 characters as
    in the style guide of ROS 2, and without any configuration or `# noqa` of the student's.
    Without ruff on the machine that grades, it is an error, which costs no point.
    """
    wanted = ", ".join(parameters.rules)
    but = f" but {', '.join(parameters.except_)}" if parameters.except_ else ""
    most = f"at most {parameters.at_most}" if parameters.at_most else "no"
    expected = f"{most} places that break ruff's rules {wanted}{but}"
    package = _python_files(submission, parameters.package)
    if isinstance(package, Cause):
        return package.finding(expected)
    if package.lint is None or package.lint.problem is not None:
        why = "ruff was not asked" if package.lint is None else package.lint.problem
        return Finding.error(expected, f"the style was not looked at: {why}")
    places = [item for item in package.lint.findings if _is_meant(item, parameters)]
    if len(places) <= parameters.at_most:
        return Finding.passed(expected, counted(len(places), "place") if places else "none")
    first = places[0]
    return Finding.failed(
        expected,
        f"{counted(len(places), 'place')}, the first at {first.file}:{first.line}: {first.code} "
        f"{first.message}",
        f"`ruff check --select {','.join(parameters.rules)}` shows them all, "
        f"`ruff rule {first.code}` explains this one.",
        Evidence(places=tuple(map(_lint_place, places[:_MOST_PLACES]))),
    )


def _is_meant(item: LintFinding, parameters: Ruff) -> bool:
    return any(_covers(rule, item.code) for rule in parameters.rules) and not any(
        _covers(rule, item.code) for rule in parameters.except_
    )


def _covers(rule: str, found: str) -> bool:
    """Whether a rule is, or a group holds, what ruff found: `E` holds E501, but not ERA001."""
    if not rule.isalpha():
        return found.startswith(rule)
    letters = found.rstrip("0123456789")
    # pylint's rules are four groups, PLC to PLW, and one.
    return letters == rule or (rule == "PL" and letters[:2] == "PL")


def _lint_place(item: LintFinding) -> SourceError:
    return SourceError(item.file, item.line, f"{item.code} {item.message}")
