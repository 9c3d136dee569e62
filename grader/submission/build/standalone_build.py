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

from grader.submission.build.installed import regular_files
from grader.submission.intake.listing import SubmissionFile
from grader.submission.intake.paths import is_within
from grader.submission.read.manifest import MANIFEST
from grader.submission.read.package import Package

# Besides the two files that make it a package, and what people read.
_INTERFACES = (".msg", ".srv", ".action", ".idl")
_DOCUMENTS = (".md", ".rst", ".txt")
_OTHERS = ("LICENSE", "README", "CHANGELOG", ".gitignore", MANIFEST)

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
    """Whether a package makes interfaces and names neither the others nor the folders above it.

    No safety depends on this: the result of such a build is only used for the same files.
    """
    manifest, cmake = package.manifest, package.cmake
    if cmake is None or manifest.error is not None or package.build_type != "ament_cmake":
        return False
    if manifest.name != package.name or others & {one.name for one in manifest.dependencies}:
        return False
    return "rosidl_generate_interfaces" in cmake and not any(
        text in cmake for text in (*others, "..")
    )


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
    # Scripts for a plain shell cannot tell where they are, and name the place of the build.
    scripts = {
        script: script.read_text(errors="surrogateescape")
        for script in regular_files(share)
        if script.parent == share and script.suffix == ".sh"
    }
    built_at = _PREFIX.search(scripts.get(share / "package.sh", ""))
    if built_at is None:
        return
    for script, text in scripts.items():
        script.write_text(text.replace(built_at[1], str(install)), errors="surrogateescape")
