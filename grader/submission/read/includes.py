"""Which packages the C++ of a package needs, by its headers and its CMakeLists.txt.

Read and never compiled, so what conditions leave out is not known: what stands in ``#if`` or
``#ifdef`` is optional, and what stands in ``#if 0`` does not count.
"""

from __future__ import annotations

import posixpath
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

from grader.recording.submission import Import
from grader.submission.read.cmake import CMakeCommand, read_commands

CODE = (".c", ".cc", ".cpp", ".cxx", ".h", ".hh", ".hpp", ".hxx")
_MOST = 2000
_PROGRAMS = ("add_executable", "add_library")
_USES = ("ament_target_dependencies", "target_link_libraries")
_NOT_CODE = ("test/", "tests/")


@dataclass(frozen=True)
class Included:
    """What a package includes and links.

    Attributes:
        packages: Other packages that it needs, and where it says so.
        own: A file of the package -> a header of the package that it includes.
    """

    packages: tuple[Import, ...] = ()
    own: tuple[tuple[str, str], ...] = ()


def is_built(path: str) -> bool:
    """Whether a file counts as its package's code; the path is relative to the package."""
    return not path.startswith(_NOT_CODE)


def read_included(
    files: Mapping[str, Sequence[tuple[str, int, bool]]],
    cmake: str | None,
    cmake_file: str,
    is_package: Callable[[str], bool],
) -> Included:
    """What the sources of a package and its CMakeLists.txt need.

    Args:
        files: Path of each source and header, from the folder of the package -> headers that it
            includes, each with its line, and whether a condition may leave it out.
        cmake_file: Path of CMakeLists.txt, as are the paths of the answer.
        is_package: Whether a name is that of another ROS package.
    """
    commands = read_commands(cmake or "")
    if not any(one.name in _PROGRAMS for one in commands):
        return Included()
    folder = cmake_file.removesuffix("CMakeLists.txt")
    packages: list[Import] = []
    own: list[tuple[str, str]] = []
    includes = (
        (path, *include)
        for path, in_file in sorted(files.items())
        if is_built(path)
        for include in in_file
    )
    for path, header, line, optional in islice(includes, _MOST):
        own_header = _own_header(header, path, files)
        package = header.partition("/")[0]
        if own_header is not None:
            own.append((folder + path, folder + own_header))
        elif "/" in header and is_package(package):
            packages.append(Import(package, folder + path, line, optional))
    linked = islice(_linked(commands, is_package), _MOST)
    packages += [Import(name, cmake_file, line) for name, line in linked]
    return Included(tuple(packages), tuple(own))


def needed_files(
    program: str, commands: Sequence[CMakeCommand], folder: str, own: Sequence[tuple[str, str]]
) -> tuple[set[str], set[int]] | None:
    """Files that a program of a CMakeLists.txt is made of, and lines of the commands about it.

    Args:
        folder: Of the package, with a slash at its end, or empty.

    Returns:
        None where CMakeLists.txt does not name the program.
    """
    programs = {
        command.arguments[0]
        for command in commands
        if command.name in _PROGRAMS and command.arguments
    }
    if program not in programs:
        return None

    def about(names: Collection[str], *kinds: str) -> list[CMakeCommand]:
        """The commands of these kinds for targets of these names."""
        return [
            command
            for command in commands
            if command.name in kinds and not set(names).isdisjoint(command.arguments[:1])
        ]

    def linked(target: str) -> set[str]:
        commands_to_link = about({target}, "target_link_libraries")
        return {word for command in commands_to_link for word in command.arguments} & programs

    targets = _reached({program}, linked)
    files = {
        folder + posixpath.normpath(word)
        for command in about(targets, *_PROGRAMS, "target_sources")
        for word in command.arguments[1:]
    }
    lines = {command.line for command in about(targets, *_USES)}
    return with_own_headers(files, own), lines


def with_own_headers(files: Iterable[str], own: Iterable[tuple[str, str]]) -> set[str]:
    """Files, and the headers of their package that they include, directly or not."""
    included: dict[str, set[str]] = {}
    for file, header in own:
        included.setdefault(file, set()).add(header)
    return _reached(files, lambda file: included.get(file, set()))


def _reached(start: Iterable[str], following: Callable[[str], set[str]]) -> set[str]:
    """Some names, those that follow from them, and so on."""
    reached = set(start)
    pending = sorted(reached)
    while pending:
        new = following(pending.pop()) - reached
        reached |= new
        pending += new
    return reached


def _own_header(header: str, includer: str, files: Collection[str]) -> str | None:
    """The file of the package that a header is: beside the includer, or in any folder."""
    beside = posixpath.normpath(posixpath.join(posixpath.dirname(includer), header))
    for path in (beside, header):
        if path in files:
            return path
    return next((path for path in files if path.endswith(f"/{header}")), None)


def _linked(
    commands: Iterable[CMakeCommand], is_package: Callable[[str], bool]
) -> Iterator[tuple[str, int]]:
    """Packages that CMakeLists.txt names for its programs; not those of its tests."""
    conditions: list[bool] = []
    for command in commands:
        words: tuple[str, ...] = ()
        if command.name == "if":
            conditions.append("BUILD_TESTING" in command.arguments)
        elif command.name == "endif":
            del conditions[-1:]
        elif any(conditions):
            continue
        elif command.name in _USES:
            words = command.arguments[1:]
        elif command.name == "find_package" and "REQUIRED" in command.arguments:
            words = command.arguments[:1]
        for name in dict.fromkeys(word.partition("::")[0] for word in words):
            # Those of ament are build tools, and declared by another tag.
            if is_package(name) and not name.startswith("ament_cmake"):
                yield name, command.line
