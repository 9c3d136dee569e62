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
    every = (
        (path, *one)
        for path, includes in sorted(files.items())
        if is_built(path)
        for one in includes
    )
    for path, header, line, optional in islice(every, _MOST):
        found = _own_header(header, path, files)
        package = header.partition("/")[0]
        if found is not None:
            own.append((folder + path, folder + found))
        elif "/" in header and is_package(package):
            packages.append(Import(package, folder + path, line, optional))
    linked = islice(_linked(commands, is_package), _MOST)
    packages += [Import(name, cmake_file, line) for name, line in linked]
    return Included(tuple(packages), tuple(own))


def needed_files(
    program: str, commands: Iterable[CMakeCommand], folder: str, own: Iterable[tuple[str, str]]
) -> tuple[set[str], set[int]] | None:
    """Files that a program of a CMakeLists.txt is made of, and lines of the commands about it.

    Args:
        folder: Of the package, with a slash at its end, or empty.

    Returns:
        None where CMakeLists.txt does not name the program.
    """
    targets = {one.arguments[0]: one for one in commands if one.name in _PROGRAMS and one.arguments}
    if program not in targets:
        return None
    about, pending = {program}, [program]
    while pending:
        name = pending.pop()
        linked = {
            word
            for one in commands
            if one.name == "target_link_libraries" and one.arguments[:1] == (name,)
            for word in one.arguments
        }
        pending += sorted((linked & targets.keys()) - about)
        about |= linked & targets.keys()
    files = {
        folder + posixpath.normpath(word)
        for one in commands
        if one.name in (*_PROGRAMS, "target_sources") and {*one.arguments[:1]} & about
        for word in one.arguments[1:]
    }
    lines = {one.line for one in commands if one.name in _USES and {*one.arguments[:1]} & about}
    return with_own_headers(files, own), lines


def with_own_headers(files: Iterable[str], own: Iterable[tuple[str, str]]) -> set[str]:
    """Files, and the headers of their package that they include, directly or not."""
    included: dict[str, set[str]] = {}
    for file, header in own:
        included.setdefault(file, set()).add(header)
    found, pending = set(files), sorted(files)
    while pending:
        more = included.get(pending.pop(), set()) - found
        found |= more
        pending += more
    return found


def _own_header(header: str, includer: str, files: Collection[str]) -> str | None:
    """The file of the package that a header is: beside the includer, or in any folder."""
    beside = posixpath.normpath(posixpath.join(posixpath.dirname(includer), header))
    ends = f"/{header}"
    return next((path for path in (beside, header) if path in files), None) or next(
        (path for path in files if path.endswith(ends)), None
    )


def _linked(
    commands: Iterable[CMakeCommand], is_package: Callable[[str], bool]
) -> Iterator[tuple[str, int]]:
    """Packages that CMakeLists.txt names for its programs; not those of its tests."""
    conditions: list[bool] = []
    for one in commands:
        if one.name == "if":
            conditions.append("BUILD_TESTING" in one.arguments)
        elif one.name == "endif":
            del conditions[-1:]
        elif any(conditions):
            continue
        elif one.name in _USES or (one.name == "find_package" and "REQUIRED" in one.arguments):
            words = one.arguments[1:] if one.name in _USES else one.arguments[:1]
            for name in dict.fromkeys(word.partition("::")[0] for word in words):
                # Those of ament are build tools, and declared by another tag.
                if is_package(name) and not name.startswith("ament_cmake"):
                    yield name, one.line
