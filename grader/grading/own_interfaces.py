"""Interfaces that are the students' own, written anew from what their definitions say.

Where the name of an interface is left open, each submission has fields of its own, and the probe
needs that definition to hear its messages. Nothing of the student's build is used for it. rosgrade
writes a package of its own, with the names and types of the fields. Comments, default values,
constants and CMakeLists.txt of the student are left out.

Publishers and subscriptions meet, because ROS compares a hash of just the names and types: RIHS01
of REP-2011 leaves default values and constants out.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath

from grader.assignment.interfaces import open_interfaces
from grader.assignment.load import LoadedAssignment
from grader.errors import GraderFault
from grader.recording.interface import DefinitionError, Section, sections_of
from grader.recording.submission import SubmissionRecord

OWN = "own_interfaces"
"""How the packages are called together where they are built."""

Definitions = Mapping[str, tuple[Section, ...]]
"""``kind/Name`` of each interface of a package -> its parts."""

_MOST_VALUES = 100_000
"""In the arrays of fixed size of one interface: a message of it is made with all of them."""
_MANIFEST = """\
<package format="3">
  <name>{name}</name>
  <version>0.0.0</version>
  <description>Interfaces of a submission</description>
  <maintainer email="rosgrade@example.org">rosgrade</maintainer>
  <license>Apache-2.0</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
{depends}  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
  <export><build_type>ament_cmake</build_type></export>
</package>
"""
_CMAKE = """\
cmake_minimum_required(VERSION 3.8)
project({name})
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
{finds}rosidl_generate_interfaces({name}
  {files}
{dependencies})
ament_package()
"""


def own_packages(loaded: LoadedAssignment, submission: SubmissionRecord) -> dict[str, Definitions]:
    """The student's interfaces that an assignment leaves open, with all that lies in them.

    Raises:
        GraderFault: A definition that was built cannot be read here.
    """
    found: dict[str, dict[str, tuple[Section, ...]]] = {}
    queue = open_interfaces(loaded.assignment, loaded.folder, loaded.values)
    while queue:
        interface = queue.pop()
        package, _, file = interface.partition("/")
        definitions = found.setdefault(package, {})
        text = _definition(submission, interface)
        if text is None or file in definitions:
            continue
        try:
            sections = definitions[file] = sections_of(interface, text)
        except DefinitionError as error:
            raise GraderFault(f"{interface} of the submission cannot be read: {error}") from error
        fields = [field for section in sections for field in section.fields]
        if sum(field.count or 0 for field in fields) > _MOST_VALUES:
            raise GraderFault(
                f"{interface} of the submission has arrays of more than {_MOST_VALUES} values"
            )
        queue += [field.type for field in fields if field.is_message]
    return {package: definitions for package, definitions in found.items() if definitions}


def _definition(submission: SubmissionRecord, interface: str) -> str | None:
    """What the build took as the definition of an interface, or None if it is not the student's."""
    name, kind, stem = interface.split("/")
    package = submission.package(name)
    made = package.generated if package is not None else ()
    files = {PurePosixPath(item.file): item.text for item in made}
    return files.get(PurePosixPath(kind, f"{stem}.{kind}"))


def write_packages(packages: Mapping[str, Definitions], folder: Path) -> None:
    """Write packages of interfaces, to be built."""
    for package, definitions in packages.items():
        files = {f"{name}.{name.partition('/')[0]}": one for name, one in definitions.items()}
        used = sorted({name for one in files.values() for name in _used(one)} - {package})
        texts = {
            "package.xml": _MANIFEST.format(
                name=package,
                depends=_lines(used, "  <depend>{}</depend>"),
            ),
            "CMakeLists.txt": _CMAKE.format(
                name=package,
                finds=_lines(used, "find_package({} REQUIRED)"),
                files="\n  ".join(f'"{file}"' for file in files),
                dependencies=f"  DEPENDENCIES {' '.join(used)}\n" if used else "",
            ),
            **{file: "---\n".join(map(_fields, one)) for file, one in files.items()},
        }
        for file, text in texts.items():
            path = folder / package / file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, "utf-8")


def _lines(names: Iterable[str], line: str) -> str:
    return "".join(f"{line.format(name)}\n" for name in names)


def _fields(section: Section) -> str:
    return _lines(map(str, section.fields), "{}")


def _used(sections: Iterable[Section]) -> Iterator[str]:
    """The packages of the messages in an interface."""
    fields = (field for section in sections for field in section.fields)
    return (field.type.partition("/")[0] for field in fields if field.is_message)
