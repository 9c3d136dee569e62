"""Interface packages that are built without the rest of their submission.

To compile the code of interfaces takes nearly all of a build's time, and what changes from one
submission to the next is the nodes. So a package that holds interfaces only, and needs nothing else
of its submission, is built as if it had been handed in alone, and kept by its content. Where it
does not build alone, the submission is built as a whole.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path

from grader.submission.intake.listing import SubmissionFile
from grader.submission.intake.paths import is_within, shown
from grader.submission.read.cmake import read_commands
from grader.submission.read.manifest import MANIFEST
from grader.submission.read.package import Package

# Besides the two files that make it a package, and what people read.
_INTERFACES = (".msg", ".srv", ".action", ".idl")
_DOCUMENTS = (".md", ".rst", ".txt")
_OTHERS = ("LICENSE", "README", "CHANGELOG", ".gitignore", MANIFEST)

# What an author uses for interfaces alone; others would miss something where the package is alone.
# No safety depends on this list: the result of such a build is only used for the same files.
_HARMLESS = """
add_compile_options add_definitions ament_export_dependencies ament_export_include_directories
ament_lint_auto_find_test_dependencies ament_package cmake_minimum_required cmake_policy else
elseif endforeach endif endwhile file find_package foreach if install list math message option
project return rosidl_generate_interfaces set string unset while
"""
_COMMANDS = frozenset(_HARMLESS.split())
_GLOBS = ("GLOB", "GLOB_RECURSE")
_PROGRAMS = frozenset({"CODE", "SCRIPT"})
_WAYS_OUT = ("..", "$ENV", "CMAKE_INSTALL_PREFIX", "CMAKE_PREFIX_PATH")
_PREFIX = re.compile(r'^_colcon_package_sh_COLCON_CURRENT_PREFIX="(/.*)"$', re.MULTILINE)


def standalone(packages: Sequence[Package], files: Iterable[SubmissionFile]) -> tuple[str, ...]:
    """Names of the packages that can be built alone; none where nothing else would be left."""
    code = [file.path for file in files if file.link is not None or not _is_harmless(file.path)]
    found = tuple(
        package.name
        for package in packages
        if _needs_nothing(package, {one.name for one in packages} - {package.name})
        and not any(is_within(path, package.folder) for path in code)
    )
    return found if len(found) < len(packages) else ()


def _is_harmless(path: str) -> bool:
    name = path.rpartition("/")[2]
    return name.endswith((*_INTERFACES, *_DOCUMENTS)) or name in _OTHERS


def _needs_nothing(package: Package, others: set[str]) -> bool:
    """Whether a package does not look at the others, and makes only its own interfaces."""
    manifest, cmake = package.manifest, package.cmake
    if cmake is None or manifest.error is not None or package.build_type != "ament_cmake":
        return False
    if manifest.name != package.name:
        return False
    named = {dependency.name for dependency in manifest.dependencies}
    if others & named or any(text in cmake for text in (*others, *_WAYS_OUT)):
        return False
    commands = read_commands(cmake)
    return any(one.name == "rosidl_generate_interfaces" for one in commands) and all(
        one.name in _COMMANDS
        and (one.name != "file" or one.arguments[:1] in [(glob,) for glob in _GLOBS])
        and _PROGRAMS.isdisjoint(one.arguments)
        and not any(argument.startswith("/") for argument in one.arguments)
        for one in commands
    )


def as_handed_in(log: str, package: str, folder: str) -> str:
    """Name the files of a package in a log by where they are in the submission."""
    return re.sub(rf"(?<![\w/.-]){package}/(?=[\w.])", lambda _: f"{shown(folder)}/", log)


def lay(package: str, built: Path, install: Path) -> None:
    """Put what a package installed into another install space, as if it had been built there.

    Args:
        built: Its own install space (merged layout); what leads out of it was taken away.
        install: Where it goes; need not be there.
    """
    # What Python compiled names the folder of its source; it is compiled again.
    ignore = shutil.ignore_patterns("__pycache__")
    shutil.copytree(built, install, symlinks=True, dirs_exist_ok=True, ignore=ignore)
    share = install / "share" / package
    built_at = _PREFIX.search((share / "package.sh").read_text(errors="surrogateescape"))
    if built_at is None:
        return
    # Scripts for a plain shell cannot tell where they are, and name the place of the build.
    for script in share.glob("*.sh"):
        text = script.read_text(errors="surrogateescape")
        script.write_text(text.replace(built_at[1], str(install)), errors="surrogateescape")
