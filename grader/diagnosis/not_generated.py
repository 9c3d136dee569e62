"""Why an interface is not defined, or no code for it was generated, deepest cause first."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import PurePosixPath

from grader.diagnosis.explanation import Symptom, cause_of, explain, explanation, mistaken, remedy
from grader.diagnosis.no_package import existing_package, why_no_package
from grader.diagnosis.not_built import why_not_built
from grader.findings.finding import Evidence, Finding, Status
from grader.findings.words import code, codes
from grader.recording.interface import DefinitionError, sections_of
from grader.recording.submission import Definition, PackageRecord, SourceError, SubmissionRecord
from grader.spec.nearest_name import nearest
from grader.submission.read.cmake import CMakeCommand, read_commands

GROUP = "rosidl_interface_packages"
GENERATORS = "rosidl_default_generators"
_GENERATE = "rosidl_generate_interfaces"
# Of ament_cmake_auto: it finds what package.xml names.
_FINDS_ALL = "ament_auto_find_build_dependencies"
_GENERATE_KEYWORDS = frozenset(
    {"DEPENDENCIES", "LIBRARY_NAME", "SKIP_INSTALL", "SKIP_GROUP_MEMBERSHIP_CHECK"}
    | {"ADD_LINTER_TESTS"}
)
_KINDS = (".msg", ".srv", ".action")


@dataclass(frozen=True)
class InterfaceName:
    """The parts of an interface's name, such as ``bot_msgs/msg/BotStatus``.

    Attributes:
        kind: ``msg``, ``srv`` or ``action``; folder and suffix of its definition.
    """

    package: str
    kind: str
    name: str

    @classmethod
    def of(cls, interface: str) -> InterfaceName:
        """Take a name apart."""
        return cls(*interface.split("/"))

    @property
    def file(self) -> str:
        """The file of its definition, in the package's folder."""
        return f"{self.kind}/{self.name}.{self.kind}"

    def __str__(self) -> str:
        """Write it in full."""
        return f"{self.package}/{self.kind}/{self.name}"


@dataclass(frozen=True)
class NoDefinition(Symptom[Finding], concept="interfaces"):
    """The definition of an interface is missing."""

    submission: SubmissionRecord
    package: PackageRecord
    interface: InterfaceName

    def found(self, item: Definition, what: str) -> Finding:
        """The cause if a definition lies at another place, or has another name."""
        wanted, file = self.package.file(self.interface.file), self.interface.file
        return mistaken(
            "other_place",
            f"found {code(item.file)}: {what}",
            Evidence(places=(SourceError(item.file, None, what),)),
            wanted=code(wanted),
            file=code(file),
        )


@dataclass(frozen=True)
class NotGenerated(Symptom[Finding], concept="interfaces"):
    """The build generated no code for an interface."""

    package: PackageRecord
    interface: InterfaceName
    definition: Definition

    @cached_property
    def commands(self) -> tuple[CMakeCommand, ...]:
        """Those of CMakeLists.txt."""
        return read_commands(self.package.cmake or "")

    def calls(self, name: str) -> list[CMakeCommand]:
        """The calls of a command of CMake."""
        return [command for command in self.commands if command.name == name]

    def finds(self, package: str) -> bool:
        """Whether find_package() is called for a package."""
        calls = self.calls("find_package")
        names = {name for command in calls for name in command.arguments[:1]}
        # A loop over names, or a variable that only CMake knows.
        is_variable = any("${" in name for name in names)
        return package in names or is_variable or bool(self.calls(_FINDS_ALL))

    def cause(self, line: int | None, observed: str, hint: str) -> Finding:
        """A cause in CMakeLists.txt."""
        place = SourceError(self.package.file("CMakeLists.txt"), line, observed.replace("`", ""))
        return Finding(f"CMakeLists.txt {observed}", hint, Evidence(places=(place,)))


def find_definition(submission: SubmissionRecord, interface: InterfaceName) -> Definition | Finding:
    """The definition of an interface, as the build took it or else as it was handed in.

    Returns:
        The definition with its path in the submission, or why there is none.
    """
    cause = why_no_package(submission, interface.package)
    if cause is not None:
        return cause
    package = existing_package(submission, interface.package)
    own = [item for item in package.definitions if item.file == package.file(interface.file)]
    built = [item for item in package.generated if item.file == interface.file]
    if built:
        # Where CMakeLists.txt takes it from is the student's affair.
        same = [item for item in (*own, *package.definitions) if item.text == built[0].text]
        return same[0] if same else Definition(package.file(interface.file), built[0].text)
    return own[0] if own else cause_of(NoDefinition(submission, package, interface))


def used_packages(interface: InterfaceName, definition: Definition) -> tuple[str, ...]:
    """Other packages whose messages a definition contains, in the order of their fields."""
    try:
        sections = sections_of(str(interface), definition.text)
    except DefinitionError:
        return ()
    types = (field.type for section in sections for field in section.fields if field.is_message)
    packages = (kind.partition("/")[0] for kind in types)
    return tuple(dict.fromkeys(name for name in packages if name != interface.package))


def why_not_generated(
    submission: SubmissionRecord, interface: InterfaceName, definition: Definition
) -> Finding | None:
    """Why the build made no code for an interface, or None if it did."""
    cause = why_no_package(submission, interface.package)
    if cause is not None:
        return cause
    package = existing_package(submission, interface.package)
    if any(item.file == interface.file for item in package.generated):
        return None
    cause = explain(NotGenerated(package, interface, definition))
    if package.build_type == "ament_cmake":
        failure = why_not_built(submission, package.name)
        if failure is not None and (cause is None or failure.status is Status.ERROR):
            return failure
        if cause is not None and failure is not None:
            # The end of the log shows what became of what is missing.
            return replace(cause, evidence=replace(cause.evidence, log=failure.evidence.log))
    if cause is not None:
        return cause
    build = submission.build
    if build is not None and build.timed_out and build.waited is None:
        # A recording of before, when nothing was kept of such a build.
        return Finding.ours("the build was ended, and nothing was kept of it: grade again")
    return mistaken(
        "not_generated",
        f"the build installed no code for {code(interface.file)}",
        Evidence(places=(SourceError(package.file("CMakeLists.txt"), None, _GENERATE),)),
        file=code(interface.file),
    )


@explanation(NoDefinition)
def near_definition(symptom: NoDefinition) -> Finding | None:
    """The file is in the wrong folder or package, or has the wrong name or suffix."""
    file, name = PurePosixPath(symptom.interface.file), symptom.interface.name
    found = {
        PurePosixPath(item.file): item
        for package in (symptom.package, *symptom.submission.packages)
        for item in package.definitions
    }
    for path, item in found.items():
        if path.name == file.name:
            return symptom.found(item, f"it lies in the folder {code(str(path.parent))}")
    stems = {path.stem.replace("_", "").lower(): path for path in found}
    match = nearest(name.lower(), stems)
    if match is None:
        return None
    what = f"it is not called {code(name)}, in CamelCase"
    if stems[match].stem == name:
        what = f"its suffix is not {code(file.suffix)}"
    return symptom.found(found[stems[match]], what)


@explanation(NoDefinition, general=True)
def no_definition(symptom: NoDefinition) -> Finding:
    """There is no such file."""
    interface = symptom.interface
    there = [item.file for item in symptom.package.definitions]
    return mistaken(
        "no_definition",
        f"there is no {code(interface.file)}"
        + (f"; found {codes(there)} only" if there else f", and no .{interface.kind} file at all"),
        kind=code(interface.kind),
        file=code(f"{interface.name}.{interface.kind}"),
    )


@explanation(NotGenerated)
def no_cmake(symptom: NotGenerated) -> Finding | None:
    """The package does not use CMake. Only CMake generates code for interfaces."""
    package = symptom.package
    if package.build_type == "ament_cmake" and package.cmake is not None:
        return None
    there = "there is no CMakeLists.txt beside package.xml"
    if package.build_type != "ament_cmake":
        there = f"the build type of {code(package.name)} is {package.build_type}"
    return mistaken(
        "no_cmake",
        f"{there}, and code for interfaces is generated by CMake only",
        Evidence(places=(SourceError(package.file("package.xml"), None, "build type"),)),
        name=package.name,
    )


@explanation(NotGenerated)
def generates_nothing(symptom: NotGenerated) -> Finding | None:
    """CMakeLists.txt does not call rosidl_generate_interfaces(), or after ament_package()."""
    calls, ended = symptom.calls(_GENERATE), symptom.calls("ament_package")
    if calls and not (ended and ended[0].line < calls[0].line):
        return None
    hint = remedy("generates_nothing", file=symptom.interface.file)
    if calls:
        return symptom.cause(ended[0].line, f"calls ament_package() before {_GENERATE}()", hint)
    match = nearest(_GENERATE, [command.name for command in symptom.commands], cutoff=0.8)
    line = next((item.line for item in symptom.commands if item.name == match), None)
    there = f"calls {code(match)}, which does not exist" if match else f"never calls {_GENERATE}"
    return symptom.cause(line, there, hint)


@explanation(NotGenerated)
def not_listed(symptom: NotGenerated) -> Finding | None:
    """rosidl_generate_interfaces() does not list the file."""
    calls, file = symptom.calls(_GENERATE), symptom.interface.file
    listed = [item for call in calls for item in call.arguments[1:] if item.endswith(_KINDS)]
    if file in listed or any("${" in item for call in calls for item in call.arguments):
        return None
    there = f", but {codes(listed)}" if listed else ""
    return symptom.cause(
        calls[0].line,
        f"does not list {code(file)}{there} in {_GENERATE}()",
        remedy("not_listed", file=file),
    )


@explanation(NotGenerated)
def undeclared_package(symptom: NotGenerated) -> Finding | None:
    """A package with used messages is not found, or is not listed under DEPENDENCIES."""
    calls = symptom.calls(_GENERATE)
    line = calls[0].line
    if not symptom.finds(GENERATORS):
        return _not_found(symptom, line, GENERATORS)
    declared = {
        name for call in calls for name in call.after("DEPENDENCIES", _GENERATE_KEYWORDS) or ()
    }
    names_a_variable = any("${" in name for name in declared)
    for name in used_packages(symptom.interface, symptom.definition):
        if not symptom.finds(name):
            return _not_found(symptom, line, name)
        if name not in declared and not names_a_variable:
            observed = (
                f"does not name {code(name)} under DEPENDENCIES, although the definition uses "
                "its messages"
            )
            return symptom.cause(line, observed, remedy("no_dependencies", name=name))
    return None


def _not_found(symptom: NotGenerated, line: int, package: str) -> Finding:
    observed = f"has no find_package() for {code(package)}"
    return symptom.cause(line, observed, remedy("no_find_package", name=package))
