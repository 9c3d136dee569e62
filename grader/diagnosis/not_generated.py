"""Why an interface was not generated: what CMakeLists.txt or package.xml lacks, deepest first."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import PurePosixPath

from grader.checks.finding import Evidence
from grader.checks.wording import code, codes
from grader.diagnosis.cause import Cause
from grader.diagnosis.explanation import Symptom, explain, explanation
from grader.diagnosis.no_definition import InterfaceName
from grader.diagnosis.not_built import existing_package, why_no_package, why_not_built
from grader.recording.interface import PRIMITIVES, DefinitionError, sections_of
from grader.spec.nearest_name import nearest
from grader.submission.read.cmake import CMakeCommand, read_commands
from grader.submission.record import Definition, PackageRecord, SourceError, SubmissionRecord

CMAKE = "CMakeLists.txt"
GROUP = "rosidl_interface_packages"
GENERATE = "rosidl_generate_interfaces"
GENERATORS = "rosidl_default_generators"

# Of ament_cmake_auto: it finds what package.xml names.
_FINDS_ALL = "ament_auto_find_build_dependencies"
_GENERATE_KEYWORDS = frozenset(
    {"DEPENDENCIES", "LIBRARY_NAME", "SKIP_INSTALL", "SKIP_GROUP_MEMBERSHIP_CHECK"}
    | {"ADD_LINTER_TESTS"}
)
_LONG_TYPE = re.compile(r"\w+/msg/\w+")
_KINDS = (".msg", ".srv", ".action")


def is_generated(submission: SubmissionRecord, interface: InterfaceName) -> bool:
    """Whether the build made code for an interface."""
    package = submission.package(interface.package)
    return package is not None and any(item.file == interface.file for item in package.generated)


def used_packages(interface: InterfaceName, definition: Definition) -> tuple[str, ...]:
    """Other packages whose messages a definition contains, in the order of their fields."""
    try:
        sections = sections_of(str(interface), definition.text)
    except DefinitionError:
        return ()
    types = (field.type for section in sections for field in section.fields if field.is_message)
    packages = (kind.partition("/")[0] for kind in types)
    return tuple(dict.fromkeys(name for name in packages if name != interface.package))


@dataclass(frozen=True)
class NotGenerated(Symptom[Cause]):
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
        found = [command.arguments[:1] for command in self.calls("find_package")]
        # A loop over names, or a variable that nobody can know.
        loop = any("${" in name for names in found for name in names)
        return (package,) in found or loop or bool(self.calls(_FINDS_ALL))

    def cause(self, line: int | None, observed: str, hint: str) -> Cause:
        """A cause in CMakeLists.txt."""
        place = SourceError(self.package.file(CMAKE), line, observed.replace("`", ""))
        return Cause(f"CMakeLists.txt {observed}", hint, Evidence(places=(place,)))


def why_not_generated(
    submission: SubmissionRecord, interface: InterfaceName, definition: Definition
) -> Cause | None:
    """Why the build made no code for an interface, or None if it did."""
    cause = why_no_package(submission, interface.package)
    if cause is not None:
        return cause
    if is_generated(submission, interface):
        return None
    package = existing_package(submission, interface.package)
    cause = explain(NotGenerated(package, interface, definition))
    built = None if package.build_type != "ament_cmake" else why_not_built(submission, package.name)
    if built is not None:
        # The end of the log shows what became of what is missing.
        log = built.evidence.log
        return built if cause is None or built.ours else _with_log(cause, log)
    return cause or Cause(
        f"the build installed no code for {code(interface.file)}",
        f"List {code(interface.file)} in {GENERATE}() in CMakeLists.txt.",
        Evidence(places=(SourceError(package.file(CMAKE), None, GENERATE),)),
    )


def _with_log(cause: Cause, log: tuple[str, ...]) -> Cause:
    evidence = Evidence(places=cause.evidence.places, log=log)
    return Cause(cause.observed, cause.hint, evidence)


@explanation(NotGenerated)
def no_cmake_package(symptom: NotGenerated) -> Cause | None:
    """The build type of the package is not ament_cmake."""
    package = symptom.package
    if package.build_type == "ament_cmake":
        return None
    return Cause(
        f"the build type of {code(package.name)} is {package.build_type}, and code for "
        "interfaces is generated by CMake only",
        "Make a package of its own for interfaces: "
        f"`ros2 pkg create --build-type ament_cmake {package.name}`.",
        Evidence(places=(SourceError(package.file("package.xml"), None, "build type"),)),
    )


@explanation(NotGenerated)
def no_cmake_file(symptom: NotGenerated) -> Cause | None:
    """There is no CMakeLists.txt."""
    if symptom.package.cmake is not None:
        return None
    return Cause(
        "there is no CMakeLists.txt beside package.xml",
        f"`ros2 pkg create --build-type ament_cmake {symptom.package.name}` makes one.",
    )


@explanation(NotGenerated)
def generates_nothing(symptom: NotGenerated) -> Cause | None:
    """CMakeLists.txt does not call rosidl_generate_interfaces()."""
    if symptom.calls(GENERATE):
        return None
    match = nearest(GENERATE, [command.name for command in symptom.commands], cutoff=0.8)
    line = next((item.line for item in symptom.commands if item.name == match), None)
    call = f'{GENERATE}(${{PROJECT_NAME}} "{symptom.interface.file}")'
    there = f"calls {code(match)}, which does not exist" if match else f"never calls {GENERATE}"
    return symptom.cause(line, there, f"Write {code(call)} before ament_package().")


@explanation(NotGenerated)
def finds_no_generators(symptom: NotGenerated) -> Cause | None:
    """CMakeLists.txt does not find rosidl_default_generators."""
    if symptom.finds(GENERATORS):
        return None
    return symptom.cause(
        None,
        f"does not find {code(GENERATORS)}",
        f"Write `find_package({GENERATORS} REQUIRED)` before {GENERATE}().",
    )


@explanation(NotGenerated)
def wrong_order(symptom: NotGenerated) -> Cause | None:
    """CMakeLists.txt calls ament_package() before rosidl_generate_interfaces()."""
    ended = symptom.calls("ament_package")
    if not ended or ended[0].line >= symptom.calls(GENERATE)[0].line:
        return None
    return symptom.cause(
        ended[0].line, f"calls ament_package() before {GENERATE}()", "ament_package() comes last."
    )


@explanation(NotGenerated)
def other_project(symptom: NotGenerated) -> Cause | None:
    """The project in CMakeLists.txt has another name than the package."""
    name = symptom.package.name
    project = symptom.calls("project")
    if not project or project[0].arguments[:1] in ((), (name,)):
        return None
    return symptom.cause(
        project[0].line,
        f"is of the project {code(project[0].arguments[0])}, but package.xml names {code(name)}",
        f"Write `project({name})`: both names must be the same.",
    )


@explanation(NotGenerated)
def not_listed(symptom: NotGenerated) -> Cause | None:
    """rosidl_generate_interfaces() does not list the file."""
    calls, file = symptom.calls(GENERATE), symptom.interface.file
    listed = [item for call in calls for item in call.arguments[1:] if item.endswith(_KINDS)]
    if file in listed or any("${" in item for call in calls for item in call.arguments):
        return None
    line = calls[0].line
    hint = f'Write "{file}" in {GENERATE}(): the path from CMakeLists.txt.'
    name = PurePosixPath(file).name
    match = next((item for item in listed if item.lower().endswith(name.lower())), None)
    match = match or nearest(file, listed, cutoff=0.75)
    if match is not None:
        return symptom.cause(line, f"lists {code(match)} instead of {code(file)}", hint)
    there = f", but {codes(listed)}" if listed else ""
    return symptom.cause(line, f"does not list {code(file)}{there} in {GENERATE}()", hint)


@explanation(NotGenerated)
def undeclared_package(symptom: NotGenerated) -> Cause | None:
    """A package whose messages are used is not under DEPENDENCIES, or is not found."""
    calls = symptom.calls(GENERATE)
    declared: set[str] = set()
    for call in calls:
        declared |= set(call.after("DEPENDENCIES", _GENERATE_KEYWORDS) or ())
    unknown = any("${" in name for name in declared)
    for name in used_packages(symptom.interface, symptom.definition):
        if name not in declared and not unknown:
            return symptom.cause(
                calls[0].line,
                f"does not name {code(name)} under DEPENDENCIES, although the definition uses "
                "its messages",
                f"Write `DEPENDENCIES {name}` at the end of {GENERATE}().",
            )
        if not symptom.finds(name):
            return symptom.cause(
                calls[0].line,
                f"does not find {code(name)}",
                f"Write `find_package({name} REQUIRED)` before {GENERATE}().",
            )
    return None


@explanation(NotGenerated)
def no_member_of_group(symptom: NotGenerated) -> Cause | None:
    """package.xml does not make the package a member of rosidl_interface_packages."""
    package = symptom.package
    if GROUP in package.groups:
        return None
    tag = f"<member_of_group>{GROUP}</member_of_group>"
    return Cause(
        f"package.xml does not make the package a member of the group {code(GROUP)}",
        f"Add {code(tag)} to package.xml.",
        Evidence(places=(SourceError(package.file("package.xml"), None, "no member_of_group"),)),
    )


@explanation(NotGenerated)
def unreadable_line(symptom: NotGenerated) -> Cause | None:
    """A line of the definition looks right, but ROS cannot read it."""
    for number, line in enumerate(symptom.definition.text.splitlines(), start=1):
        written = line.partition("#")[0]
        what = hint = ""
        if line[:1].isspace() and written.strip():
            what = "begins with a blank"
            hint = "Begin every line of a definition at its first column."
        elif _LONG_TYPE.match(written):
            what = "names a type with `msg` in the middle"
            hint = "In a definition a type is written package/Name, such as geometry_msgs/Pose2D."
        if what:
            place = SourceError(symptom.definition.file, number, what.replace("`", ""))
            return Cause(
                f"{symptom.definition.file}:{number} {what}, and ROS cannot read that",
                hint,
                Evidence(places=(place,)),
            )
    return None


@explanation(NotGenerated)
def unknown_type(symptom: NotGenerated) -> Cause | None:
    """The definition names a type that is neither one of ROS nor of the package."""
    package, interface, definition = symptom.package, symptom.interface, symptom.definition
    try:
        sections = sections_of(str(interface), definition.text)
    except DefinitionError:
        return None
    own = {PurePosixPath(item.file).stem for item in package.definitions}
    for section in sections:
        for field in section.fields:
            of_package, _, name = field.type.replace("/msg/", "/").rpartition("/")
            if of_package != interface.package or name in own:
                continue
            line = section.lines.get(field.name)
            meant = nearest(name, PRIMITIVES)
            return Cause(
                f"{definition.file}:{line} names the type {code(name)}, which is neither a type of "
                f"ROS nor a message of {code(package.name)}",
                f"Write {code(meant)}."
                if meant
                else f"A message of another package has its name in front: `package/{name}`.",
                Evidence(places=(SourceError(definition.file, line, f"{name} does not exist"),)),
            )
    return None
