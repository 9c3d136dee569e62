"""Checks of an interface package: its definition, its code, its package.xml."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from itertools import chain, islice
from math import prod
from pathlib import PurePosixPath
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, model_validator
from pydantic import Field as Parameter

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.checks.interface.asked_fields import (
    FAMILIES,
    Alternatives,
    all_fields,
    assigned,
    words_of,
)
from grader.checks.interface.definition_differences import (
    Difference,
    constant_differences,
    field_differences,
)
from grader.checks.wrong_name import Named
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.no_package import existing_package, why_no_manifest
from grader.diagnosis.not_generated import (
    GENERATORS,
    GROUP,
    InterfaceName,
    find_definition,
    used_packages,
    why_not_generated,
)
from grader.findings.finding import Comparison, Evidence, Finding, Table
from grader.findings.words import code, codes, listing, worded
from grader.recording.interface import (
    PRIMITIVES,
    DefinitionError,
    Field,
    Section,
    fields_of,
    sections_of,
)
from grader.recording.submission import Definition, PackageRecord, SourceError, SubmissionRecord
from grader.spec.name import INTERFACE
from grader.spec.name import InterfaceName as Interface
from grader.spec.names import Thing

_BUILD_KINDS = frozenset({"buildtool_depend", "build_depend", "depend"})
_RUN_KINDS = frozenset({"exec_depend", "run_depend", "depend"})
_RUNTIME = "rosidl_default_runtime"
_PARTS = {1: ("",), 2: ("request", "response"), 3: ("goal", "result", "feedback")}
_OF_KIND = {"msg": 1, "srv": 2, "action": 3}
_MOST_CHOICES = 256
_MOST_FIELDS = 1000


class OfInterface(Parameters):
    """Part of the parameters of every check of an interface."""

    interface: Interface = Parameter(description="Full name, such as bot_msgs/msg/BotStatus.")

    @property
    def parts(self) -> InterfaceName:
        """The name, taken apart."""
        return InterfaceName.of(self.interface)

    def own(self, submission: SubmissionRecord) -> InterfaceName:
        """The name that the student gave it."""
        own = submission.names.own(Thing.INTERFACE, self.interface)
        return replace(self.parts, name=own.rpartition("/")[2])


class Found(OfInterface, Named):
    """Parameters of interface.found."""

    asks = "a definition in `{self.parts.file}` of `{self.parts.package}`"
    thing, called = Thing.INTERFACE, "{self.interface}"


@check("interface.found", Subject.SUBMISSION, Found, concept="interfaces")
def found(submission: SubmissionRecord, parameters: Found) -> Finding:
    """The definition of the interface is there.

    Judged by the files that were handed in: `msg/<Name>.msg` (or `srv/<Name>.srv`,
    `action/<Name>.action`) beside package.xml. A file in another place also counts if the build
    generated the interface from it.
    """
    definition = find_definition(submission, parameters.parts)
    if not isinstance(definition, Finding):
        return Finding.as_asked(f"found {code(definition.file)}")
    own = submission.names.own(*parameters.asked_name)
    if own == parameters.interface:
        return definition
    seen = f"{definition.observed}; everything else was judged with {code(own)}"
    return replace(definition, observed=seen, names=parameters.wrong(own))


def _definition(submission: SubmissionRecord, parameters: OfInterface) -> Definition:
    """The student's definition; ends the check if there is none."""
    definition = find_definition(submission, parameters.own(submission))
    if isinstance(definition, Finding):
        stop_if(definition)
        raise AssertionError
    return definition


class Generated(OfInterface):
    """Parameters of interface.generated."""

    asks = "`colcon build` generates `{self.interface}`"


@check("interface.generated", Subject.SUBMISSION, Generated, concept="interfaces")
def generated(submission: SubmissionRecord, parameters: Generated) -> Finding:
    """The build generates code for the interface.

    Judged by what `colcon build` installed, not by how CMakeLists.txt is written.
    """
    definition = _definition(submission, parameters)
    stop_if(why_not_generated(submission, parameters.own(submission), definition))
    return Finding.as_asked("generated and installed")


class Defined(OfInterface):
    """Parameters of interface.fields and interface.constants."""

    definition: str = Parameter(
        description="Text of the .msg, .srv or .action file as it should be."
    )

    @model_validator(mode="after")
    def _readable(self) -> Defined:
        sections_of(self.interface, self.definition)
        return self

    @property
    def sections(self) -> tuple[Section, ...]:
        """What the definition consists of."""
        return sections_of(self.interface, self.definition)


class Fields(Defined):
    """Parameters of interface.fields."""

    order: Literal["same", "any"] = Parameter(
        "same",
        description="`any`: the fields may be in another order. Then only nodes that use the "
        "student's own definition can communicate.",
    )

    def _asked(self) -> str:
        wanted = [str(item) for section in self.sections for item in section.fields]
        free = ", in any order" if self.order == "any" and len(wanted) > 1 else ""
        return f"the fields {codes(wanted)}{free}" if wanted else "no field"


@check("interface.fields", Subject.SUBMISSION, Fields, concept="interfaces")
def fields(submission: SubmissionRecord, parameters: Fields) -> Finding:
    """The interface has the expected fields.

    Compares name, type, array bound and order of all fields. Comments, blanks, default values and
    constants do not matter. Two nodes can communicate only if all of this is the same: ROS compares
    a hash of it.
    """
    differ = partial(field_differences, in_order=parameters.order == "same")
    return _compared(submission, parameters, differ)


def _alternatives(written: Any) -> Any:
    """A type alone, or several of which one is enough; those in a list of their own go together."""
    choices = written if isinstance(written, list | tuple) else [written]
    return tuple(tuple(one) if isinstance(one, list | tuple) else (one,) for one in choices)


class Has(OfInterface):
    """Parameters of interface.has."""

    fields: dict[str, Annotated[Alternatives, BeforeValidator(_alternatives)]] = Parameter(
        description="What for -> the type of the field, such as `float64`, `float64[]`, "
        "`geometry_msgs/msg/Pose`, or one of the words `number`, `integer`, `float` and `text`. Of "
        "a list, one type is enough; a list in it, such as `[float64, float64]`, stands for "
        "several fields.",
        min_length=1,
    )
    part: Literal["request", "response", "goal", "result", "feedback"] | None = Parameter(
        None, description="Part of a service or an action; by default all parts together."
    )

    @model_validator(mode="after")
    def _known(self) -> Has:
        for what, alternatives in self.fields.items():
            for type in chain.from_iterable(alternatives):
                single = type.removesuffix("[]")
                is_known = single in PRIMITIVES or single in FAMILIES
                if not is_known and not re.fullmatch(INTERFACE, single):
                    raise ValueError(
                        f"{what}: {type!r} is no type of a field, such as float64, text or "
                        "geometry_msgs/msg/Pose"
                    )
        if prod(map(len, self.fields.values())) > _MOST_CHOICES:
            raise ValueError(f"'fields' leave more than {_MOST_CHOICES} choices")
        parts = _PARTS[_OF_KIND[self.parts.kind]]
        if self.part is not None and self.part not in parts:
            raise ValueError(f"a {self.parts.kind} has no part {self.part!r}")
        return self

    def _asked(self) -> str:
        wanted = (f"{what} ({words_of(types)})" for what, types in self.fields.items())
        place = f" in its {self.part}" if self.part else ""
        return f"`{self.interface}` has fields{place} for {listing(wanted)}"


@check("interface.has", Subject.SUBMISSION, Has, concept="interfaces")
def has(submission: SubmissionRecord, parameters: Has) -> Finding:
    """The interface has fields for what is asked, under any name and in any order.

    Judged by the types of the fields. Each field stands for one thing only. The fields of the
    package's own messages in it count too, and further fields do not matter.
    """
    name = parameters.own(submission)
    definition = _definition(submission, parameters)
    own = _sections(name, definition)
    stop_if(_why_other_parts(name, definition, own, Evidence()))
    sections = list(own)
    if parameters.part is not None:
        sections = [own[_PARTS[len(own)].index(parameters.part)]]
    written = [field for section in sections for field in section.fields]
    messages = dict(_own_messages(submission, name))
    fields = list(islice(all_fields(written, messages), _MOST_FIELDS))
    found = assigned(parameters.fields, fields)
    assignments = [
        f"{what} is {codes(field.name for field in found[what])}"
        for what in parameters.fields
        if what in found
    ]
    lacking = {what: types for what, types in parameters.fields.items() if what not in found}
    if not lacking:
        return Finding.as_asked("; ".join(assignments))
    seen = f"{code(definition.file)} has {codes(map(str, written)) or 'no field'}: "
    seen += f"no field is left for {listing(lacking)}"
    if assignments:
        seen += f" ({listing(assignments)})"
    return mistaken(
        "no_field_for",
        seen,
        Evidence(places=(SourceError(definition.file, None, "lacks a field"),)),
        fields=listing(f"{words_of(types)} for {what}" for what, types in lacking.items()),
    )


def _own_messages(
    submission: SubmissionRecord, name: InterfaceName
) -> Iterator[tuple[str, tuple[Field, ...]]]:
    """The messages of a package, each with its fields; what cannot be read has none."""
    package = existing_package(submission, name.package)
    for item in (*package.definitions, *package.generated):
        path = PurePosixPath(item.file)
        if path.suffix == ".msg":
            full = f"{name.package}/msg/{path.stem}"
            yield full, tuple(fields_of(full, item.text).values())


class Constants(Defined):
    """Parameters of interface.constants."""

    def _asked(self) -> str:
        wanted = [str(item) for section in self.sections for item in section.constants]
        return f"the constants {codes(wanted)}" if wanted else "no constant"


@check("interface.constants", Subject.SUBMISSION, Constants, concept="interfaces")
def constants(submission: SubmissionRecord, parameters: Constants) -> Finding:
    """The interface has the expected constants.

    Compares name, type and value. Their order and additional constants do not matter.
    """
    return _compared(submission, parameters, constant_differences)


def _compared(
    submission: SubmissionRecord,
    parameters: Defined,
    differ: Callable[[Section, Section, str], Iterator[Difference]],
) -> Finding:
    name, wanted = parameters.parts, parameters.sections
    definition = _definition(submission, parameters)
    own = _sections(name, definition)
    title = f"{name.file}: as it should be, and yours"
    sides = (Comparison(title, tuple(_lines(wanted)), tuple(_lines(own))),)
    stop_if(_why_other_parts(name, definition, own, Evidence(comparisons=sides)))
    differing = [
        (item, section.lines.get(item.name))
        for expected, section in zip(wanted, own, strict=True)
        for item in differ(expected, section, name.package)
    ]
    if not differing:
        return Finding.as_asked(f"found in {code(definition.file)}")
    places = tuple(
        SourceError(definition.file, line, item.text.replace("`", "")) for item, line in differing
    )
    return mistaken(
        "other_definition",
        "; ".join(item.text for item, _ in differing),
        Evidence(places=places[:10], comparisons=sides),
        write=" ".join(dict.fromkeys(item.hint for item, _ in differing[:2])),
    )


def _sections(name: InterfaceName, definition: Definition) -> tuple[Section, ...]:
    """The parts of a student's definition; ends the check where it cannot be read."""
    try:
        return sections_of(str(name), definition.text)
    except DefinitionError as error:
        shown = Evidence(places=(SourceError(definition.file, error.line, "cannot be read"),))
        seen = f"{definition.file}:{error.line} cannot be read: {error}"
        stop_if(mistaken("unreadable_definition", seen, shown))
        raise


def _why_other_parts(
    name: InterfaceName, definition: Definition, own: tuple[Section, ...], shown: Evidence
) -> Finding | None:
    """Why a definition has not the parts of its kind, or None if it has."""
    wanted = _OF_KIND[name.kind]
    if len(own) == wanted:
        return None
    seen = f"{code(definition.file)} has {len(own) - 1} lines `---`, not {wanted - 1}"
    parts = listing(_PARTS[wanted])
    return mistaken("other_parts", seen, shown, kind=name.kind, parts=parts)


def _lines(sections: tuple[Section, ...]) -> Iterator[str]:
    for number, section in enumerate(sections):
        if number:
            yield "---"
        yield from map(str, section.constants)
        yield from map(str, section.fields)


class Manifest(OfInterface):
    """Parameters of interface.manifest."""

    asks = (
        "package.xml of `{self.parts.package}` has what an interface package needs, and the "
        "package is registered where ROS looks for it"
    )


@check("interface.manifest", Subject.SUBMISSION, Manifest, concept="interfaces")
def manifest(submission: SubmissionRecord, parameters: Manifest) -> Finding:
    """package.xml names the packages that an interface package needs.

    It must have `rosidl_default_generators` as `buildtool_depend` (or `build_depend`, `depend`),
    `rosidl_default_runtime` as `exec_depend` (or `depend`), the group `rosidl_interface_packages`,
    and each package whose messages the definition uses as `depend` (or one tag for the build and
    one for the run). Without these entries, the build works only on a machine where all of the
    packages are installed. A package that was built must also be in ament's index of packages,
    where `ros2 interface show` looks.
    """
    definition = _definition(submission, parameters)
    stop_if(why_no_manifest(submission, parameters.parts.package))
    package = existing_package(submission, parameters.parts.package)
    missing = tuple(_missing(package, used_packages(parameters.parts, definition)))
    if missing:
        return mistaken(
            "no_entry",
            f"package.xml lacks {listing(f'{code(tag)} ({why})' for tag, why in missing)}",
            Evidence(
                places=(SourceError(package.file("package.xml"), None, "entries are missing"),),
                tables=(Table("What package.xml lacks", ("entry", "what it is for"), missing),),
            ),
            tags=codes(tag for tag, _ in missing),
        )
    if package.registered:
        return Finding.as_asked("every entry is there")
    cmake = package.file("CMakeLists.txt")
    return mistaken(
        "unregistered",
        f"{code(package.name)} was installed, but not registered: neither `ros2 interface show` "
        "nor another package finds it",
        Evidence(places=(SourceError(cmake, None, "ends without it"),)),
        cmake=code(cmake),
    )


def _missing(package: PackageRecord, used: Iterable[str]) -> Iterator[tuple[str, str]]:
    """The tags that package.xml lacks, with what each is for."""
    building = {item.name for item in package.dependencies if item.kind in _BUILD_KINDS}
    running = {item.name for item in package.dependencies if item.kind in _RUN_KINDS}
    wanted = [
        ("buildtool_depend", GENERATORS, GENERATORS in building, "generates the code"),
        ("exec_depend", _RUNTIME, _RUNTIME in running, "what the generated code needs to run"),
        ("member_of_group", GROUP, GROUP in package.groups, "says that it holds interfaces"),
    ]
    for name in used:
        if name not in building and name not in running:
            wanted.append(("depend", name, False, "the definition uses its messages"))
        else:
            why = "the generator reads its definitions"
            wanted.append(("build_depend", name, name in building, why))
            why = f"its messages are {worded('imported', 'included')}"
            wanted.append(("exec_depend", name, name in running, why))
    for kind, name, is_there, why in wanted:
        if not is_there:
            yield f"<{kind}>{name}</{kind}>", why
