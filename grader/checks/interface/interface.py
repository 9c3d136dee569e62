"""Checks of an interface package: its definition, its code, its package.xml."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from pydantic import Field as Parameter
from pydantic import model_validator

from grader.checks.check import Parameters, Subject, check
from grader.checks.finding import Comparison, Evidence, Finding, Table
from grader.checks.interface.definition_differences import (
    Difference,
    constant_differences,
    field_differences,
)
from grader.checks.package.dependency import INSIDE_EXPORT
from grader.checks.wording import code, codes, listing
from grader.diagnosis.not_built import existing_package, why_no_manifest
from grader.diagnosis.not_generated import (
    GENERATORS,
    GROUP,
    InterfaceName,
    find_definition,
    used_packages,
    why_not_generated,
)
from grader.recording.interface import DefinitionError, Section, sections_of
from grader.spec.name import InterfaceName as Interface
from grader.submission.record import Definition, PackageRecord, SourceError, SubmissionRecord

_BUILD_KINDS = frozenset({"buildtool_depend", "build_depend", "depend"})
_RUN_KINDS = frozenset({"exec_depend", "run_depend", "depend"})
_RUNTIME = "rosidl_default_runtime"
_PARTS = {1: ("",), 2: ("request", "response"), 3: ("goal", "result", "feedback")}


class OfInterface(Parameters):
    """Parameters of interface.found, interface.generated and interface.manifest."""

    interface: Interface = Parameter(description="Full name, such as bot_msgs/msg/BotStatus.")

    @property
    def parts(self) -> InterfaceName:
        """The name, taken apart."""
        return InterfaceName.of(self.interface)


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


@check("interface.found", Subject.SUBMISSION, OfInterface)
def found(submission: SubmissionRecord, parameters: OfInterface) -> Finding:
    """The definition of the interface is there.

    Judged by the files that were handed in: `msg/<Name>.msg` (or `srv/<Name>.srv`,
    `action/<Name>.action`) beside package.xml. A file from elsewhere counts as well, if the
    build generated the interface from it.
    """
    expected = f"a definition in {code(parameters.parts.file)} of {code(parameters.parts.package)}"
    definition = find_definition(submission, parameters.parts)
    if not isinstance(definition, Definition):
        return definition.finding(expected)
    return Finding.passed(expected, f"found {code(definition.file)}")


@check("interface.generated", Subject.SUBMISSION, OfInterface)
def generated(submission: SubmissionRecord, parameters: OfInterface) -> Finding:
    """The build generates code for the interface.

    Judged by what `colcon build` installed, not by how CMakeLists.txt is written.
    """
    expected = f"`colcon build` generates {code(parameters.interface)}"
    definition = find_definition(submission, parameters.parts)
    if not isinstance(definition, Definition):
        return definition.finding(expected)
    cause = why_not_generated(submission, parameters.parts, definition)
    if cause is not None:
        return cause.finding(expected)
    return Finding.passed(expected, "generated and installed")


@check("interface.fields", Subject.SUBMISSION, Defined)
def fields(submission: SubmissionRecord, parameters: Defined) -> Finding:
    """The interface has the expected fields.

    Compares name, type, array bound and order of all fields. Comments, blanks, default values
    and constants do not matter. Two nodes understand each other only if all of this is the same:
    ROS compares a hash of it.
    """
    wanted = [str(item) for section in parameters.sections for item in section.fields]
    expected = f"the fields {codes(wanted)}" if wanted else "no field"
    return _compared(submission, parameters, expected, field_differences)


@check("interface.constants", Subject.SUBMISSION, Defined)
def constants(submission: SubmissionRecord, parameters: Defined) -> Finding:
    """The interface has the expected constants.

    Compares name, type and value. Their order does not matter, nor do further constants.
    """
    wanted = [str(item) for section in parameters.sections for item in section.constants]
    expected = f"the constants {codes(wanted)}" if wanted else "no constant"
    return _compared(submission, parameters, expected, constant_differences)


def _compared(
    submission: SubmissionRecord,
    parameters: Defined,
    expected: str,
    differ: Callable[[Section, Section, str], Iterator[Difference]],
) -> Finding:
    name = parameters.parts
    definition = find_definition(submission, name)
    if not isinstance(definition, Definition):
        return definition.finding(expected)
    wanted = parameters.sections
    try:
        own = sections_of(str(name), definition.text)
    except DefinitionError as error:
        return Finding.failed(
            expected,
            f"{definition.file}:{error.line} cannot be read: {error}",
            "A line holds a type and a name, such as `float64 x`, or a constant, such as "
            "`uint8 ON=1`; `#` begins a comment.",
            Evidence(places=(SourceError(definition.file, error.line, "cannot be read"),)),
        )
    title = f"{name.file}: as it should be, and yours"
    sides = Comparison(title, tuple(_lines(wanted)), tuple(_lines(own)))
    if len(own) != len(wanted):
        return Finding.failed(
            expected,
            f"{code(definition.file)} has {len(own) - 1} lines `---`, not {len(wanted) - 1}",
            f"The parts of a .{name.kind} file are {listing(_PARTS[len(wanted)])}, with a line "
            "`---` between them.",
            Evidence(comparisons=(sides,)),
        )
    found = [
        (item, section)
        for ours, section in zip(wanted, own, strict=True)
        for item in differ(ours, section, name.package)
    ]
    if not found:
        return Finding.passed(expected, f"so says {code(definition.file)}")
    places = [
        SourceError(definition.file, section.lines.get(item.name), item.text.replace("`", ""))
        for item, section in found
    ]
    return Finding.failed(
        expected,
        "; ".join(item.text for item, _ in found),
        " ".join(dict.fromkeys(item.hint for item, _ in found[:2])),
        Evidence(places=tuple(places[:10]), comparisons=(sides,)),
    )


def _lines(sections: tuple[Section, ...]) -> Iterator[str]:
    for number, section in enumerate(sections):
        if number:
            yield "---"
        yield from map(str, section.constants)
        yield from map(str, section.fields)


@check("interface.manifest", Subject.SUBMISSION, OfInterface)
def manifest(submission: SubmissionRecord, parameters: OfInterface) -> Finding:
    """package.xml names what an interface package needs.

    `rosidl_default_generators` by `buildtool_depend` (or `build_depend`, `depend`),
    `rosidl_default_runtime` by `exec_depend` (or `depend`), membership of the group
    `rosidl_interface_packages`, and each package whose messages the definition uses by `depend`
    (or by one tag for the build and one for the run). On the machine where all of it is
    installed the build does without these; on another one it fails. A package that was built must
    be in ament's index of packages, where `ros2 interface show` looks.
    """
    expected = f"package.xml of {code(parameters.parts.package)} is that of an interface package"
    definition = find_definition(submission, parameters.parts)
    if not isinstance(definition, Definition):
        return definition.finding(expected)
    cause = why_no_manifest(submission, parameters.parts.package)
    if cause is not None:
        return cause.finding(expected)
    package = existing_package(submission, parameters.parts.package)
    missing = [
        (tag, f"{why}; {INSIDE_EXPORT}" if _is_misplaced(package, tag) else why)
        for tag, why in _missing(package, used_packages(parameters.parts, definition))
    ]
    if not missing and not package.registered:
        return _unregistered(package, expected)
    if not missing:
        return Finding.passed(expected, "every entry is there")
    return Finding.failed(
        expected,
        f"package.xml lacks {listing(f'{code(tag)} ({why})' for tag, why in missing)}",
        f"Add to package.xml: {codes(tag for tag, _ in missing)}.",
        Evidence(
            places=(SourceError(package.file("package.xml"), None, "entries are missing"),),
            tables=(Table("What package.xml lacks", ("entry", "what it is for"), tuple(missing)),),
        ),
    )


def _unregistered(package: PackageRecord, expected: str) -> Finding:
    return Finding.failed(
        f"{expected}, and registered where ROS looks for packages",
        f"{code(package.name)} was installed, but not registered: neither `ros2 interface show` "
        "nor another package finds it",
        f"End {code(package.file('CMakeLists.txt'))} with ament_package().",
        Evidence(
            places=(SourceError(package.file("CMakeLists.txt"), None, "ends without it"),),
        ),
    )


def _is_misplaced(package: PackageRecord, tag: str) -> bool:
    """Whether package.xml has what a tag names inside <export>."""
    return any(
        item.kind.startswith("export/") and f">{item.name}<" in tag for item in package.dependencies
    )


def _missing(package: PackageRecord, used: Iterable[str]) -> Iterator[tuple[str, str]]:
    """The tags that package.xml lacks, with what each is for."""
    building = {item.name for item in package.dependencies if item.kind in _BUILD_KINDS}
    running = {item.name for item in package.dependencies if item.kind in _RUN_KINDS}
    if GENERATORS not in building:
        yield f"<buildtool_depend>{GENERATORS}</buildtool_depend>", "generates the code"
    if _RUNTIME not in running:
        yield f"<exec_depend>{_RUNTIME}</exec_depend>", "what the generated code needs to run"
    if GROUP not in package.groups:
        yield f"<member_of_group>{GROUP}</member_of_group>", "says that it holds interfaces"
    for name in used:
        if name not in building and name not in running:
            yield f"<depend>{name}</depend>", "the definition uses its messages"
        elif name not in building:
            yield f"<build_depend>{name}</build_depend>", "the generator reads its definitions"
        elif name not in running:
            yield f"<exec_depend>{name}</exec_depend>", "its messages are imported"
