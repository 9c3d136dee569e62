"""Packages of ROS 2 that were built once, carried to other machines of the same kind."""

from __future__ import annotations

import re
import shutil
import subprocess
import sysconfig
import tarfile
import tempfile
import urllib.request
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from grader.errors import GraderFault, UsageError
from grader.machine.bootstrap import UNDERLAYS_FILE
from grader.machine.resources import INSTALL
from grader.machine.ros import RosInstallation, site_packages
from grader.machine.scratch import Scratch
from grader.recording.submission import BuildRecord
from grader.spec.name import ID
from grader.submission.build.build_cache import tree_hash
from grader.submission.intake.members import MIB
from grader.submission.underlay.building import digest
from grader.submission.underlay.kept import Installed
from grader.submission.underlay.packages import Packages
from grader.submission.underlay.portable import (
    CONTENTS,
    FORM,
    MANIFEST,
    Carried,
    Contents,
    kind_of,
    sha256_of,
    unpack_whole,
)

_COMPILED = "__pycache__"
_HASH = re.compile("[0-9a-f]{64}")
_HASH_MARK = "#sha256="
_ANSWER_S = 30.0
# Longer texts are data, in which no path of a machine stands.
_MOST_TEXT = 4 * MIB


def export(packages: Packages, names: Iterable[str], file: Path) -> list[str]:
    """Write built packages, with all that they need, to an archive; their names.

    Args:
        names: By default all that is there.

    Raises:
        UsageError: One is not built here.
    """
    built = packages.built()
    chosen = list(names) or sorted(built)
    installs = packages.chain(chosen)
    if not installs:
        raise UsageError(
            "not everything of it is built here; first run: rosgrade underlay add "
            f"{' '.join(chosen) or 'PACKAGE'}"
        )
    notes = {install: note for note, install in built.values()}
    file.parent.mkdir(parents=True, exist_ok=True)
    with Scratch("export") as scratch:
        carried = [_copied(install, notes[install], scratch) for install in reversed(installs)]
        contents = Contents(FORM, kind_of(packages.ros), _places(packages.ros), tuple(carried))
        (scratch / MANIFEST).write_bytes(CONTENTS.dump_json(contents, indent=1))
        members = [package.note.name for package in carried]
        _write_archive(file, scratch, [MANIFEST, *members])
    return members


def _copied(install: Path, note: Installed, folder: Path) -> Carried:
    """Copy a built package into a folder, without what holds for this machine alone."""
    copy = folder / note.name
    shutil.copytree(install, copy, symlinks=True, ignore=shutil.ignore_patterns(_COMPILED))
    # What a file of a course asked for is here asked for by its own name.
    names = tuple(place for place in note.places if re.fullmatch(ID, place)) or (note.name,)
    return Carried(replace(note, ros="", installation="", places=names), tree_hash(copy))


def _write_archive(file: Path, folder: Path, members: Sequence[str]) -> None:
    draft = file.with_name(f".{file.name}.unfinished")
    try:
        with tarfile.open(draft, "w:gz", format=tarfile.PAX_FORMAT) as archive:
            for name in members:
                archive.add(folder / name, name, filter=_anonymous)
        draft.replace(file)
    except OSError as error:
        raise UsageError(f"{file}: cannot be written: {error.strerror}") from error
    finally:
        draft.unlink(missing_ok=True)


def _anonymous(member: tarfile.TarInfo) -> tarfile.TarInfo:
    member.uid = member.gid = 0
    member.uname = member.gname = ""
    return member


def _places(ros: RosInstallation) -> dict[str, str]:
    """Paths of this machine that a build writes into its files."""
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
    where, _, expected_hash = place.partition(_HASH_MARK)
    if is_address(place):
        if _was_imported(packages, expected_hash):
            return []
        with tempfile.TemporaryDirectory() as folder:
            file = _download(where, expected_hash, Path(folder))
            return _import(packages, file, expected_hash)
    file = Path(where)
    if not file.is_file():
        raise UsageError(f"{where}: there is no such file")
    actual_hash = sha256_of(file)
    if expected_hash not in ("", actual_hash):
        raise UsageError(
            f"{where}: is damaged, or is not what was meant: its hash is {actual_hash}"
        )
    return [] if _was_imported(packages, actual_hash) else _import(packages, file, actual_hash)


def is_address(place: str) -> bool:
    """Whether this is an address, with the hash of what lies there.

    Raises:
        UsageError: It is an address of another form.
    """
    url, _, expected_hash = place.partition(_HASH_MARK)
    if "://" not in url:
        return False
    if not url.startswith("https://") or not _HASH.fullmatch(expected_hash):
        raise UsageError(f"{url}: write https://ADDRESS{_HASH_MARK}HASH")
    return True


def _download(url: str, expected_hash: str, folder: Path) -> Path:
    file = folder / (url.rpartition("/")[2] or UNDERLAYS_FILE)
    try:
        with urllib.request.urlopen(url, timeout=_ANSWER_S) as answer, file.open("wb") as out:
            shutil.copyfileobj(answer, out)
    except (OSError, ValueError) as error:
        reason = getattr(error, "reason", error)
        raise GraderFault(f"{url}: cannot be fetched: {reason}") from error
    actual_hash = sha256_of(file)
    if actual_hash != expected_hash:
        raise UsageError(f"{url}: is not what was meant: its hash is {actual_hash}")
    return file


def _imported_file(packages: Packages, sha256: str) -> Path:
    """The file that lists the builds of an archive, for the ROS installation as it is now."""
    return packages.folder / "imported" / f"{sha256}-{digest(packages.ros)[:16]}"


def _was_imported(packages: Packages, sha256: str) -> bool:
    """Whether all that an archive holds was taken from it, and is still there."""
    try:
        keys = _imported_file(packages, sha256).read_text(encoding="ascii").split()
    except OSError:
        return False
    return all(packages.kept.find(key) for key in keys)


def _import(packages: Packages, file: Path, sha256: str) -> list[str]:
    """Keep the packages of an archive; names of those that were not here."""
    with Scratch("import") as scratch:
        contents = unpack_whole(file, scratch)
        difference = contents.kind.difference(kind_of(packages.ros))
        if difference:
            raise UsageError(
                f"{file.name}: cannot be used on this machine: {difference}. Build the "
                "packages here with `rosgrade underlay add`"
            )
        keys, new_packages = _keep(packages, contents, scratch)
    list_of_keys = _imported_file(packages, sha256)
    list_of_keys.parent.mkdir(parents=True, exist_ok=True)
    list_of_keys.write_text("\n".join(keys), encoding="ascii")
    return new_packages


def _keep(packages: Packages, contents: Contents, folder: Path) -> tuple[list[str], list[str]]:
    """Keep what is not there yet as if it were built here: keys of all, names of the new."""
    ros, kept = packages.ros, packages.kept
    here = _places(ros)
    moved = {old: here[what] for what, old in contents.paths.items() if what in here}
    keys: dict[str, str] = {}
    new_packages = []
    for package in contents.packages:
        note = replace(package.note, installation=digest(ros))
        key = keys[note.name] = packages.key(note, keys)
        if not kept.has(key):
            with kept.cache.locked(key, wait_s=_ANSWER_S), kept.cache.unfinished() as unfinished:
                install = unfinished / INSTALL
                shutil.copytree(folder / note.name, install, symlinks=True)
                _rewrite(install, moved)
                _compile(install, ros)
                kept.cache.store(key, unfinished, BuildRecord(succeeded=True, duration_s=0.0))
            new_packages.append(note.name)
        kept.note(key, note)
    return [*keys.values()], new_packages


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
