"""Packages of ROS 2 that were built once, carried to other machines of the same kind.

The archive is a ``.tar.gz`` with ``underlays.json`` and a folder for each package. It is refused
where it would not run: built programs hold for one processor, one release of one system, one
Python and the versions of ROS that they were built on.
"""

from __future__ import annotations

import hashlib
import platform
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tempfile
import urllib.request
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from grader.errors import GraderFault, SubmissionError, UsageError
from grader.machine.bootstrap import UNDERLAYS_FILE
from grader.machine.resources import INSTALL
from grader.machine.ros import RosInstallation, site_packages
from grader.machine.scratch import Scratch
from grader.recording.submission import BuildRecord
from grader.spec.name import ID
from grader.submission.build.build_cache import tree_hash
from grader.submission.intake.archive import unpack
from grader.submission.intake.members import MIB, ArchiveLimits
from grader.submission.underlay.building import digest, versions
from grader.submission.underlay.distribution import SNAPSHOT
from grader.submission.underlay.kept import Installed
from grader.submission.underlay.packages import Packages
from grader.submission.underlay.system_libraries import this_system

MANIFEST = "underlays.json"
_FORM = 1
_LIMITS = ArchiveLimits(total_bytes=4096 * MIB, members=200_000, depth=60)
_COMPILED = "__pycache__"
_HASH = re.compile("[0-9a-f]{64}")
_HASH_MARK = "#sha256="
_ANSWER_S = 30.0
# Longer texts are data, in which no path of a machine stands.
_MOST_TEXT = 4 * MIB


@dataclass(frozen=True)
class Kind:
    """What built programs hold for.

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
        for what, wanted, found in (
            ("processor", (self.machine,), (here.machine,)),
            ("system", (self.system,), (here.system,)),
            ("Python", (self.python,), (here.python,)),
            ("ROS", self.ros, here.ros),
        ):
            if wanted != found:
                first, second = _without(wanted, found), _without(found, wanted)
                return f"it is for another {what}, {first}, and here is {second}"
        return ""


def _without(some: Sequence[str], others: Sequence[str]) -> str:
    """The first few of some texts that are not among others."""
    return " ".join([one for one in some if one not in others][:3]) or "none of these"


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
    """

    form: int
    kind: Kind
    paths: Mapping[str, str]
    packages: tuple[Carried, ...]


_CONTENTS = TypeAdapter(Contents)


def kind_of(ros: RosInstallation) -> Kind:
    """What programs hold for that are built on this machine."""
    wheels, _ = versions(ros)
    system = this_system()
    libc = "-".join(platform.libc_ver())
    return Kind(
        platform.machine(),
        f"{system.id} {system.codename} {libc}",
        f"{sys.version_info.major}.{sys.version_info.minor}",
        tuple(wheels or sorted(_sourced(ros))),
    )


def _sourced(ros: RosInstallation) -> Iterator[str]:
    """The client libraries of a sourced ROS, each with a hash: all else is built on them."""
    for prefix in ros.prefixes:
        for file in sorted(prefix.glob("lib/librc*.so")):
            yield f"{file.name}-{hashlib.sha256(file.read_bytes()).hexdigest()[:12]}"


def export(packages: Packages, names: Iterable[str], file: Path) -> list[str]:
    """Write built packages, with all that they need, to an archive; their names.

    Args:
        names: By default all that is there.

    Raises:
        UsageError: One is not built here.
    """
    there = packages.there()
    chosen = list(names) or sorted(there)
    paths = packages.chain(chosen)
    if paths is None or not paths:
        raise UsageError(
            "not everything of it is built here; first run: rosgrade underlay add "
            f"{' '.join(chosen) or 'PACKAGE'}"
        )
    notes = {install: note for note, install in there.values()}
    file.parent.mkdir(parents=True, exist_ok=True)
    with Scratch("export") as scratch:
        carried = []
        for install in reversed(paths):
            note = notes[install]
            asked = tuple(place for place in note.places if re.fullmatch(ID, place))
            # What a file of a course asked for is here asked for by its own name.
            note = replace(note, ros="", installation="", places=asked or (note.name,))
            copy = scratch / note.name
            shutil.copytree(install, copy, symlinks=True, ignore=shutil.ignore_patterns(_COMPILED))
            carried.append(Carried(note, tree_hash(copy)))
        contents = Contents(_FORM, kind_of(packages.ros), _places(packages.ros), tuple(carried))
        (scratch / MANIFEST).write_bytes(_CONTENTS.dump_json(contents, indent=1))
        draft = file.with_name(f".{file.name}.unfinished")
        try:
            with tarfile.open(draft, "w:gz", format=tarfile.PAX_FORMAT) as archive:
                for name in (MANIFEST, *(one.note.name for one in carried)):
                    archive.add(scratch / name, name, filter=_anonymous)
            draft.replace(file)
        except OSError as error:
            raise UsageError(f"{file}: cannot be written: {error.strerror}") from error
        finally:
            draft.unlink(missing_ok=True)
    return [one.note.name for one in carried]


def _anonymous(member: tarfile.TarInfo) -> tarfile.TarInfo:
    member.uid = member.gid = 0
    for name in ("uname", "gname"):
        setattr(member, name, "")
    return member


def _places(ros: RosInstallation) -> dict[str, str]:
    return {
        "prefix": str(ros.prefixes[0]),
        "python": str(ros.python),
        "include": sysconfig.get_path("include"),
    }


def bring(packages: Packages, place: str) -> list[str]:
    """Take packages from an archive, unless they are there; names of those that were not.

    Args:
        place: A file, or ``https://ADDRESS#sha256=HASH``.

    Raises:
        UsageError: It is no such archive, was damaged, or is for another kind of machine.
        GraderFault: It cannot be fetched.
    """
    with _at_hand(place, packages) as file:
        if file is None:
            return []
        with Scratch("import") as scratch:
            contents = _unpacked(file, scratch)
            difference = contents.kind.difference(kind_of(packages.ros))
            if difference:
                raise UsageError(
                    f"{file.name}: cannot be used on this machine: {difference}. Build the "
                    "packages here with `rosgrade underlay add`"
                )
            keys, brought = _keep(packages, contents, scratch)
        mark = _mark(packages, sha256_of(file))
        mark.parent.mkdir(parents=True, exist_ok=True)
        mark.write_text("\n".join(keys), encoding="ascii")
    return brought


def is_address(place: str) -> bool:
    """Whether this is an address, with the hash of what lies there.

    Raises:
        UsageError: It is an address of another form.
    """
    url, _, wanted = place.partition(_HASH_MARK)
    if "://" not in url:
        return False
    if not url.startswith("https://") or not _HASH.fullmatch(wanted):
        raise UsageError(f"{url}: write https://ADDRESS{_HASH_MARK}HASH")
    return True


def check_archive(file: Path) -> None:
    """See that a file is what :func:`export` wrote, for whichever kind of machine.

    Raises:
        UsageError: It is not.
    """
    if not file.is_file():
        raise UsageError(f"{file}: there is no such file")
    with Scratch("archive") as scratch:
        _unpacked(file, scratch)


def _unpacked(file: Path, folder: Path) -> Contents:
    """What an archive holds, unpacked into a folder and whole."""
    try:
        unpack(file, folder, _LIMITS)
    except SubmissionError as error:
        raise UsageError(str(error)) from error
    contents = _read(folder, file.name)
    for one in contents.packages:
        _check(folder / one.note.name, one, file.name)
    return contents


def _mark(packages: Packages, sha256: str) -> Path:
    """The file that says which builds came from an archive, for the installation as it is now."""
    return packages.folder / "imported" / f"{sha256}-{digest(packages.ros)[:16]}"


def _is_there(packages: Packages, sha256: str) -> bool:
    try:
        keys = _mark(packages, sha256).read_text(encoding="ascii").split()
    except OSError:
        return False
    return all(packages.kept.find(key) for key in keys)


@contextmanager
def _at_hand(place: str, packages: Packages) -> Iterator[Path | None]:
    """The file itself, or a download; None if all of it is there already."""
    url, _, wanted = place.partition(_HASH_MARK)
    if not is_address(place):
        file = Path(url)
        if not file.is_file():
            raise UsageError(f"{url}: there is no such file")
        found = sha256_of(file)
        if wanted not in ("", found):
            raise UsageError(f"{url}: is damaged, or is not what was meant: its hash is {found}")
        yield None if _is_there(packages, found) else file
        return
    if _is_there(packages, wanted):
        yield None
        return
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, url.rpartition("/")[2] or UNDERLAYS_FILE)
        try:
            with urllib.request.urlopen(url, timeout=_ANSWER_S) as answer, file.open("wb") as out:
                shutil.copyfileobj(answer, out)
        except (OSError, ValueError) as error:
            reason = getattr(error, "reason", error)
            raise GraderFault(f"{url}: cannot be fetched: {reason}") from error
        found = sha256_of(file)
        if found != wanted:
            raise UsageError(f"{url}: is not what was meant: its hash is {found}")
        yield file


def sha256_of(file: Path) -> str:
    """The hash of a file, as hex."""
    with file.open("rb") as opened:
        total = hashlib.sha256()
        while block := opened.read(MIB):
            total.update(block)
    return total.hexdigest()


def _read(folder: Path, name: str) -> Contents:
    try:
        contents = _CONTENTS.validate_json((folder / MANIFEST).read_bytes())
    except (OSError, ValidationError) as error:
        raise UsageError(f"{name}: is not an archive of `rosgrade underlay export`") from error
    if contents.form != _FORM:
        raise UsageError(f"{name}: was written by another version of rosgrade")
    known: set[str] = set()
    for one in contents.packages:
        note = one.note
        names = {note.name, *note.packages, *note.places, *note.needs}
        if not all(re.fullmatch(ID, name) for name in names) or not known.issuperset(note.needs):
            raise UsageError(f"{name}: its {MANIFEST} is damaged at {note.name!r}")
        known.add(note.name)
    if any(one.note.snapshot != SNAPSHOT.version for one in contents.packages):
        raise UsageError(
            f"{name}: was made with another day of the index of ROS 2 than {SNAPSHOT.version}: use "
            "the version of rosgrade that made it, or make it again with this one"
        )
    return contents


def _check(folder: Path, one: Carried, name: str) -> None:
    """See that a package is whole, and that nothing in it leads outside."""
    for path in folder.rglob("*"):
        if path.is_symlink() and not path.resolve().is_relative_to(folder.resolve()):
            raise UsageError(f"{name}: {path.relative_to(folder.parent)}: leads outside")
    if not folder.is_dir() or tree_hash(folder) != one.sha256:
        raise UsageError(f"{name}: the files of {one.note.name!r} are damaged")


def _keep(packages: Packages, contents: Contents, folder: Path) -> tuple[list[str], list[str]]:
    """Keep what is not there yet as if it were built here: keys of all, names of the new."""
    here, ros = _places(packages.ros), packages.ros
    moved = {old: here[what] for what, old in contents.paths.items() if what in here}
    keys: dict[str, str] = {}
    brought = []
    for one in contents.packages:
        note = replace(one.note, installation=digest(ros))
        key = keys[note.name] = packages.key(note, keys)
        if not packages.kept.has(key):
            cache = packages.kept.cache
            with cache.locked(key, wait_s=_ANSWER_S), cache.unfinished() as unfinished:
                install = unfinished / INSTALL
                shutil.copytree(folder / note.name, install, symlinks=True)
                _rewrite(install, moved)
                _compile(install, ros)
                cache.store(key, unfinished, BuildRecord(succeeded=True, duration_s=0.0))
            brought.append(note.name)
        packages.kept.note(key, note)
    return [*keys.values()], brought


def _rewrite(install: Path, moved: Mapping[str, str]) -> None:
    """Put places of this machine for those of the other into texts, such as CMake's."""
    longest_first = sorted(moved, key=len, reverse=True)
    pattern = re.compile(b"|".join(re.escape(old.encode()) for old in longest_first))
    for path in install.rglob("*"):
        if path.is_symlink() or not path.is_file() or path.stat().st_size > _MOST_TEXT:
            continue
        data = path.read_bytes()
        if b"\0" not in data and pattern.search(data):
            path.write_bytes(pattern.sub(lambda found: moved[found[0].decode()].encode(), data))


def _compile(install: Path, ros: RosInstallation) -> None:
    """Compile its Python, so that nodes start without doing it."""
    folders = [str(path) for path in site_packages(install)]
    if folders:
        command = [str(ros.python), "-I", "-S", "-m", "compileall", "-qq", *folders]
        subprocess.run(command, check=False, capture_output=True)
