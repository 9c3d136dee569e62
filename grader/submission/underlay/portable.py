"""An archive of built packages: what it says of itself, and whether it is whole.

It is a ``.tar.gz`` with ``underlays.json`` and a folder for each package. Built programs only run
on one processor, one release of one system, one Python and the versions of ROS that they were
built on, so it says those, too.
"""

from __future__ import annotations

import hashlib
import platform
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from grader.errors import SubmissionError, UsageError
from grader.machine.ros import RosInstallation
from grader.machine.scratch import Scratch
from grader.spec.name import ID
from grader.submission.build.build_cache import tree_hash
from grader.submission.intake.archive import unpack
from grader.submission.intake.members import MIB, ArchiveLimits
from grader.submission.underlay.building import versions
from grader.submission.underlay.distribution import SNAPSHOT
from grader.submission.underlay.kept import Installed
from grader.submission.underlay.system_libraries import this_system

MANIFEST = "underlays.json"
FORM = 1
"""Raise it when an earlier rosgrade could not read the archive."""
_LIMITS = ArchiveLimits(total_bytes=4096 * MIB, members=200_000, depth=60)


@dataclass(frozen=True)
class Kind:
    """The kind of machine on which built programs run.

    Attributes:
        machine: The processor, as ``uname -m`` says it.
        system: The Linux distribution and its C library: ``debian bookworm glibc-2.36``.
        python: Version, such as ``3.12``.
        ros: The wheels of ROS with their versions, or the client libraries of a sourced ROS.
    """

    machine: str
    system: str
    python: str
    ros: tuple[str, ...]

    def difference(self, here: Kind) -> str:
        """In what this machine differs first, in words; nothing if it does not."""
        for what, theirs, ours in (
            ("processor", (self.machine,), (here.machine,)),
            ("system", (self.system,), (here.system,)),
            ("Python", (self.python,), (here.python,)),
            ("ROS", self.ros, here.ros),
        ):
            if theirs != ours:
                return (
                    f"it is for another {what}, {_first_only_in(theirs, ours)}, and here is "
                    f"{_first_only_in(ours, theirs)}"
                )
        return ""


def _first_only_in(texts: Sequence[str], others: Sequence[str]) -> str:
    return " ".join([text for text in texts if text not in others][:3]) or "none of these"


def kind_of(ros: RosInstallation) -> Kind:
    """The kind of this machine."""
    wheels, _ = versions(ros)
    system = this_system()
    libc = "-".join(platform.libc_ver())
    return Kind(
        platform.machine(),
        f"{system.id} {system.codename} {libc}",
        f"{sys.version_info.major}.{sys.version_info.minor}",
        tuple(wheels or sorted(_client_libraries(ros))),
    )


def _client_libraries(ros: RosInstallation) -> Iterator[str]:
    """Those of a sourced ROS, each with a hash: all else is built on them."""
    for prefix in ros.prefixes:
        for file in sorted(prefix.glob("lib/librc*.so")):
            yield f"{file.name}-{sha256_of(file)[:12]}"


def sha256_of(file: Path) -> str:
    """The hash of a file, as hex."""
    with file.open("rb") as opened:
        total = hashlib.sha256()
        while block := opened.read(MIB):
            total.update(block)
    return total.hexdigest()


@dataclass(frozen=True)
class Carried:
    """One package in the archive: its note, and the hash of its files."""

    note: Installed
    sha256: str


@dataclass(frozen=True)
class Contents:
    """``underlays.json``.

    Attributes:
        paths: Places of the machine that built them, which stand in some files.
        packages: In an order in which each comes after those that it needs.
    """

    form: int
    kind: Kind
    paths: Mapping[str, str]
    packages: tuple[Carried, ...]


CONTENTS = TypeAdapter(Contents)


def check_archive(file: Path) -> None:
    """See that a file is an archive of built packages, for whichever kind of machine.

    Raises:
        UsageError: It is not.
    """
    if not file.is_file():
        raise UsageError(f"{file}: there is no such file")
    with Scratch("archive") as scratch:
        unpack_whole(file, scratch)


def unpack_whole(file: Path, folder: Path) -> Contents:
    """Unpack an archive into a folder; what it says of itself.

    Raises:
        UsageError: It is no such archive, or not whole.
    """
    try:
        unpack(file, folder, _LIMITS)
    except SubmissionError as error:
        raise UsageError(str(error)) from error
    contents = _contents(folder, file.name)
    for package in contents.packages:
        _check_files(folder / package.note.name, package, file.name)
    return contents


def _contents(folder: Path, archive: str) -> Contents:
    try:
        contents = CONTENTS.validate_json((folder / MANIFEST).read_bytes())
    except (OSError, ValidationError) as error:
        raise UsageError(f"{archive}: is not an archive of `rosgrade underlay export`") from error
    if contents.form != FORM:
        raise UsageError(f"{archive}: was written by another version of rosgrade")
    notes = [package.note for package in contents.packages]
    earlier: set[str] = set()
    for note in notes:
        names = {note.name, *note.packages, *note.places, *note.needs}
        if not all(re.fullmatch(ID, name) for name in names) or not earlier.issuperset(note.needs):
            raise UsageError(f"{archive}: its {MANIFEST} is damaged at {note.name!r}")
        earlier.add(note.name)
    if any(note.snapshot != SNAPSHOT.version for note in notes):
        raise UsageError(
            f"{archive}: was made with another day of the index of ROS 2 than {SNAPSHOT.version}: "
            "use the version of rosgrade that made it, or make it again with this one"
        )
    return contents


def _check_files(folder: Path, package: Carried, archive: str) -> None:
    """See that a package is whole, and that nothing in it leads outside."""
    for path in folder.rglob("*"):
        if path.is_symlink() and not path.resolve().is_relative_to(folder.resolve()):
            raise UsageError(f"{archive}: {path.relative_to(folder.parent)}: leads outside")
    if not folder.is_dir() or tree_hash(folder) != package.sha256:
        raise UsageError(f"{archive}: the files of {package.note.name!r} are damaged")
