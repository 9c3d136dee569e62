"""The check of classes: what they inherit, override and declare."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Annotated

from pydantic import AfterValidator, Field

from grader.checks.check import Subject, check
from grader.checks.package.package import OfPackage
from grader.checks.source.judged import judged_package, unless_unread
from grader.diagnosis.explanation import mistaken
from grader.findings.finding import Evidence, Finding
from grader.findings.words import code, codes, listing, worded
from grader.recording.submission import (
    CPP,
    SourceError,
    SourceFile,
    SourceFunction,
    SubmissionRecord,
)
from grader.spec.nearest_name import nearest
from grader.submission.read.inheritance import NODE, Family, FoundClass, methods

_BASE = re.compile(r"[A-Za-z_]\w*((\.|::)[A-Za-z_]\w*)*")
_MEMBER = re.compile(r"[A-Za-z_]\w*")
_MOST_CLASSES = 10


def _base_name(text: str) -> str:
    if not _BASE.fullmatch(text):
        raise ValueError(f"{text!r} is no class, such as {NODE!r}, 'rclcpp::Node' or 'RobotNode'")
    return text


def _member_name(text: str) -> str:
    if not _MEMBER.fullmatch(text):
        raise ValueError(f"{text!r} is no name of a method or a field: write it without brackets")
    return text


_Members = tuple[Annotated[str, AfterValidator(_member_name)], ...]


class Class(OfPackage):
    """Parameters of source.class."""

    name: str | None = Field(None, description="Name of the class; by default any.")
    inherits: Annotated[str, AfterValidator(_base_name)] | None = Field(
        NODE,
        description="Class that it inherits: its name (`RobotNode`), or with its module or "
        "namespace. `Node` and the default are a node in either language; `null` asks for none.",
    )
    abstract: bool | None = Field(
        None,
        description="Whether it must be abstract, or must not: with a method that is `= 0` in C++, "
        "`@abstractmethod` of a class with `ABC` in Python.",
    )
    overrides: _Members = Field(
        (),
        description="Methods that it defines itself and that a base class of the submission "
        "declares; in C++, virtual ones.",
    )
    declares: _Members = Field((), description="Methods and fields that it declares itself.")
    shares: _Members = Field(
        (),
        description="Methods and fields that it declares, and that no class which inherits it "
        "declares again.",
    )
    at_least: int = Field(1, ge=1, description="How many such classes there are.")

    def _asked(self) -> str:
        several = self.at_least > 1
        what = f"the class {code(self.name)}" if self.name else "a class"
        base = re.split(r"\.|::", self.inherits)[-1] if self.inherits else ""
        is_abstract = {True: "abstract", False: "not abstract", None: ""}[self.abstract]
        asked = [
            f"inherits {code(base)}" if base else "",
            f"is {is_abstract}" if is_abstract else "",
            f"overrides {codes(self.overrides)}" if self.overrides else "",
            f"declares {codes(self.declares)}" if self.declares else "",
            f"declares {codes(self.shares)} for all that inherit it" if self.shares else "",
        ]
        number = f"at least {self.at_least} times: " if several else ""
        asks = listing(filter(None, asked))
        return f"{number}{what} that {asks}" if asks else f"{number}{what}"


@check("source.class", Subject.SUBMISSION, Class)
def class_(submission: SubmissionRecord, parameters: Class) -> Finding:
    """The class is there, and inherits Node or another class.

    Judged by the syntax of the package's files in Python and C++; nothing is compiled. It does not
    matter how the base class is imported or called (`rclpy.node.Node`, `import ... as`, an alias,
    `using`, `typedef`), and whether it is inherited directly or through another class in any file.
    A lifecycle node is a node. Where the class is missed and a part of the C++ could not be read, a
    person has to look.
    """
    package, files = judged_package(submission, parameters.package)
    family = Family([file for other in submission.packages for file in other.sources])
    classes = [item for item in family.classes if any(item.file is file for file in files)]
    named = [item for item in classes if parameters.name in (None, item.found.short)]
    kin = [
        item
        for item in named
        if parameters.inherits is None or family.inherits(item, parameters.inherits)
    ]
    if not kin:
        missed = _why_no_class(family, classes, named, parameters)
        return unless_unread(submission, package, missed)
    why_not = [_why_not_as_asked(family, item, parameters) for item in kin]
    right = [item for item, why in zip(kin, why_not, strict=True) if why is None]
    if len(right) < parameters.at_least:
        missed = next(filter(None, why_not), None) or _too_few(right, parameters)
        return unless_unread(submission, package, missed)
    places = tuple(_place(item, f"class {item.found.name}") for item in right)
    where = ", ".join(f"{place.file}:{place.line}" for place in places[:3])
    observed = f"{codes(item.found.name for item in right)} ({where})"
    return Finding.as_asked(observed, Evidence(places=places[: parameters.at_least]))


def _why_no_class(
    family: Family, classes: Sequence[FoundClass], named: Sequence[FoundClass], parameters: Class
) -> Finding:
    write = _write(parameters)
    if not classes:
        return mistaken("no_class", "no class is defined in the package", write=write)
    evidence = _shown((item, _inherits(item)) for item in classes)
    if not named:
        there = sorted({item.found.short for item in classes})
        match = nearest(parameters.name or "", there)
        found = f"found the class {code(match)}" if match else f"found {codes(there)} only"
        return mistaken("other_class", found, evidence, name=code(parameters.name or ""))
    for item in named:
        foreign = family.foreign(item)
        if foreign:
            seen = f"{code(item.found.name)} inherits {codes(foreign)}, which was not handed in"
            hint = "A person has to look at the class: the source of its base class is needed."
            return Finding.ours(seen, hint)
    place = _place(named[0], "")
    seen = "; ".join(_inherits(item) for item in named[:4])
    return mistaken("no_class", f"{seen} ({place.file}:{place.line})", evidence, write=write)


def _write(parameters: Class) -> str:
    """The lines that make such a class."""
    name, inherits = parameters.name or "MyClass", parameters.inherits
    if inherits is None:
        return worded(python=code(f"class {name}:"), cpp=code(f"class {name} {{ ... }};"))
    module, _, base = inherits.rpartition(".")
    python = f"class {name}({base}):"
    cpp_base = "rclcpp::Node" if inherits in (NODE, "Node") else inherits.replace(".", "::")
    return worded(
        python=codes([f"from {module} import {base}", python]) if module else code(python),
        cpp=code(f"class {name} : public {cpp_base}"),
    )


def _too_few(right: Sequence[FoundClass], parameters: Class) -> Finding:
    seen = f"only {codes(item.found.name for item in right)}: {len(right)} of {parameters.at_least}"
    shown = _shown((item, _inherits(item)) for item in right)
    return mistaken("too_few_classes", seen, shown, number=str(parameters.at_least))


def _why_not_as_asked(family: Family, item: FoundClass, parameters: Class) -> Finding | None:
    """What a class lacks of what is asked besides what it inherits; None if nothing."""
    asks = (_why_not_so_abstract, _why_no_override, _why_not_declared, _why_declared_again)
    return next(filter(None, (why(family, item, parameters) for why in asks)), None)


def _why_not_so_abstract(family: Family, item: FoundClass, parameters: Class) -> Finding | None:
    name = code(item.found.name)
    if parameters.abstract in (None, family.is_abstract(item)):
        return None
    if not parameters.abstract:
        state = "is abstract"
        return mistaken("abstract", f"{name} {state} ({_at(item)})", _shown([(item, state)]))
    foreign = family.foreign(item)
    if foreign:
        seen = f"{name} inherits {codes(foreign)}, which was not handed in"
        return Finding.ours(seen, "A person has to look whether the class is abstract.")
    state = "is not abstract"
    return mistaken("not_abstract", f"{name} {state} ({_at(item)})", _shown([(item, state)]))


def _why_no_override(family: Family, item: FoundClass, parameters: Class) -> Finding | None:
    for method in parameters.overrides:
        lack = _why_not_overridden(family, item, method)
        if lack:
            seen = f"{code(item.found.name)} {lack} ({_at(item)})"
            shown = _shown([(item, lack.replace("`", ""))])
            return mistaken("not_overridden", seen, shown, name=method)
    return None


def _why_not_declared(_: Family, item: FoundClass, parameters: Class) -> Finding | None:
    declared = _members(item)
    for member in (*parameters.declares, *parameters.shares):
        if member not in declared:
            there = nearest(member, sorted(declared))
            near = f"; it has {code(there)}" if there else ""
            seen = f"{code(item.found.name)} does not declare {code(member)} ({_at(item)}){near}"
            shown = _shown([(item, f"{member} is not declared here")])
            return mistaken("declared_elsewhere", seen, shown, name=code(member))
    return None


def _why_declared_again(family: Family, item: FoundClass, parameters: Class) -> Finding | None:
    name = code(item.found.name)
    for member in parameters.shares:
        for heir in family.heirs(item):
            line = _members(heir).get(member)
            if line is not None:
                place = SourceError(heir.file.path, line, f"{member} is declared again")
                seen = f"{code(heir.found.name)}, which inherits {name}, declares {code(member)}"
                again = f"{seen} again ({place.file}:{line})"
                shown = Evidence(places=(place,))
                return mistaken("declared_again", again, shown, name=code(member), base=name)
    return None


def _why_not_overridden(family: Family, item: FoundClass, method: str) -> str | None:
    """Why a class does not override a method, to be read after its name; None if it does."""
    own = [one for one in methods(item) if one.short == method]
    above = family.inherited(item, method)
    if not own:
        return f"does not define {code(f'{method}()')} itself"
    if any(one.overriding and not one.pure for one in own):
        # The compiler sees to it that it overrides another one.
        return None
    if not above:
        if _may_inherit_more(family, item):
            return None
        return f"defines {code(f'{method}()')}, which no class that it inherits declares"
    if item.file.language == CPP and not any(_overrides_one(one, above) for one in own):
        return f"defines {code(f'{method}()')}, which is not virtual with these parameters above"
    return None


def _may_inherit_more(family: Family, item: FoundClass) -> bool:
    """Whether a class inherits one whose methods are not known, such as those of rclpy."""
    if family.foreign(item):
        return True
    if item.file.language == CPP or family.own_ancestors(item):
        return False
    return any(name != "object" for name in item.found.bases)


def _overrides_one(method: SourceFunction, above: Iterable[SourceFunction]) -> bool:
    return any(one.virtual and one.parameters == method.parameters for one in above)


def _members(item: FoundClass) -> dict[str, int]:
    """Methods and fields that a class declares itself, with their lines."""
    return {**dict(item.found.fields), **{one.short: one.line for one in methods(item)}}


def _inherits(item: FoundClass) -> str:
    return f"{code(item.found.name)} inherits {codes(item.found.bases) or 'nothing'}"


def _place(item: FoundClass, message: str) -> SourceError:
    return SourceError(item.file.path, item.found.line, message)


def _at(item: FoundClass) -> str:
    file: SourceFile = item.file
    return f"{file.path}:{item.found.line}"


def _shown(items: Iterable[tuple[FoundClass, str]]) -> Evidence:
    places = [_place(item, message) for item, message in items]
    return Evidence(places=tuple(places[:_MOST_CLASSES]))
