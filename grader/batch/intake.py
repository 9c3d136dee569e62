"""Who handed in what: from a folder, an archive or a roster to a row for each student."""

from __future__ import annotations

import os
import re
import shutil
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from grader.batch.collected import (
    FOREIGN,
    NOTHING,
    Collected,
    is_ignored,
    only_archive,
    stem_of,
    submission_in,
)
from grader.batch.groups import with_groups
from grader.batch.hand_in_time import (
    CANVAS_TIMES,
    NOT_KNOWN,
    of_canvas,
    of_metadata,
    of_name,
    timed,
)
from grader.batch.roster import Roster, Student
from grader.batch.roster_match import matched, unique
from grader.course.load import Course
from grader.errors import GraderFault, RosgradeError, SubmissionError, UsageError
from grader.findings.words import listing
from grader.report.formats.canvas_comments import carrier
from grader.report.formats.canvas_gradebook import DOWNLOAD
from grader.submission.git import run_git
from grader.submission.intake.archive import SUFFIXES, unpack
from grader.submission.intake.members import MIB, ArchiveLimits
from grader.submission.intake.paths import shown
from grader.submission.read.manifest import MANIFEST

GRADESCOPE_METADATA = "submission_metadata.yml"
# How Moodle names what it lets a teacher download: a folder of each student, or a single file.
_MOODLE = re.compile(r"(?P<name>[^_]+)_\d+_assignsubmission_file_.*", re.DOTALL)
# What Canvas adds to the name of a file that was handed in again: ws-1.zip.
_AGAIN = re.compile(r"-\d+(?=(\.tar)?\.[^.]+$)")
_REPOSITORY = re.compile(r"(https?|ssh|git|file)://|[\w.-]+@[\w.-]+:")
_CLONE_LIMIT_S = 120.0
_CLASS_LIMITS = ArchiveLimits(total_bytes=8192 * MIB, members=500_000)


def collect(
    source: Path,
    staging: Path,
    roster: Roster | None = None,
    on_left_out: Callable[[str], None] = lambda _: None,
    out: Path | None = None,
    course: Course | None = None,
) -> list[Collected]:
    """Find out who handed in what, and when."""
    folder = _opened(source, staging)
    _refuse_single(folder, source)
    rows = list(_rows(folder, staging, on_left_out, out))
    if not rows:
        raise UsageError(f"{source}: holds no submission; expected one folder or archive for each")
    if any(row.download for row in rows):
        times = of_canvas(folder, source.parent if source.is_file() else None, on_left_out)
        for index, row in enumerate(rows):
            if row.download:
                user = row.names[0]
                rows[index] = row.at(times.get(user, NOT_KNOWN))
    if roster is not None:
        rows = matched(rows, roster)
    return with_groups(timed(unique(rows), staging), course)


def collect_roster(
    roster: Roster,
    base: Path,
    staging: Path,
    on_taken: Callable[[str], None] = lambda _: None,
    course: Course | None = None,
) -> list[Collected]:
    """Find what a roster itself names, as paths or URLs of git repositories."""
    if not any(student.submission for student in roster.students):
        raise UsageError(
            "the roster names no submissions; give it a column `submission` with paths or URLs, "
            "or name the folder of submissions"
        )
    rows = []
    # A repository that a whole team names is fetched once.
    cloned: dict[str, Collected] = {}
    for student in roster.students:
        row = _from_roster(student, base, staging, cloned.get(student.submission))
        rows.append(row)
        if _REPOSITORY.match(student.submission):
            cloned.setdefault(student.submission, row)
        on_taken(student.key)
    return with_groups(timed(unique(rows), staging), course)


def _from_roster(
    student: Student, base: Path, staging: Path, cloned: Collected | None
) -> Collected:
    row = Collected("").of(student)
    if not student.submission:
        return row.with_problem(NOTHING)
    if cloned is not None:
        return replace(row, path=cloned.path, fault=cloned.fault)
    if _REPOSITORY.match(student.submission):
        target = staging / f"clone-{student.row}"
        problem = _clone(student.submission, target)
        return replace(row, fault=problem) if problem else replace(row, path=target)
    path = base / student.submission
    # Path.exists() raises where no file can have that name.
    if os.path.exists(path):  # noqa: PTH110
        return replace(row, path=path)
    return replace(row, fault=f"{shown(str(path))} does not exist")


def _clone(url: str, target: Path) -> str:
    options = ["--quiet", "--depth", "1", "--no-recurse-submodules"]
    try:
        run_git(["clone", *options, "--", url, str(target)], target.parent, _CLONE_LIMIT_S)
    except GraderFault as fault:
        return str(fault)
    return ""


def _opened(source: Path, staging: Path) -> Path:
    if source.is_dir():
        return _inner(source, is_unpacked=False)
    if not source.is_file():
        raise UsageError(f"{source}: does not exist")
    if not source.name.lower().endswith(SUFFIXES):
        raise UsageError(f"{source}: is neither a folder nor an archive ({', '.join(SUFFIXES)})")
    target = staging / "class"
    target.mkdir()
    try:
        unpack(source, target, _CLASS_LIMITS)
    except RosgradeError as error:
        raise UsageError(str(error)) from error
    return _inner(target, is_unpacked=True)


def _inner(folder: Path, *, is_unpacked: bool) -> Path:
    """The only folder in a folder, where it is that of the class: an archive or an export of it."""
    items = [item for item in folder.iterdir() if not is_ignored(item)]
    if len(items) != 1 or not items[0].is_dir():
        return folder
    is_export = (items[0] / GRADESCOPE_METADATA).is_file()
    is_of_archive = is_unpacked and not _manifest_of_one(items[0])
    return items[0] if is_export or is_of_archive else folder


def _refuse_single(folder: Path, source: Path) -> None:
    manifest = _manifest_of_one(folder)
    if manifest is not None:
        raise UsageError(
            f"{source}: looks like one submission ({shown(str(manifest))} is in it); name the "
            "folder that holds those of the class, or use `rosgrade check`"
        )


def _manifest_of_one(folder: Path) -> Path | None:
    """The package.xml by which a folder looks like one submission, relative to it; or None."""
    manifests = [folder / MANIFEST, *sorted((folder / "src").glob(f"*/{MANIFEST}"))]
    return next((file.relative_to(folder) for file in manifests if file.is_file()), None)


def _rows(
    folder: Path, staging: Path, on_left_out: Callable[[str], None], out: Path | None
) -> Iterator[Collected]:
    metadata = _gradescope(folder / GRADESCOPE_METADATA)
    canvas: dict[str, list[_Download]] = {}
    for item in sorted(folder.iterdir(), key=lambda path: os.fsencode(path.name)):
        if is_ignored(item) or item.name == GRADESCOPE_METADATA or item.match(CANVAS_TIMES):
            continue
        # Path.resolve() raises at a link that leads to itself.
        if out is not None and os.path.realpath(item) == os.path.realpath(out):
            continue
        match = DOWNLOAD.fullmatch(item.name) if item.is_file() else None
        if item.name in metadata:
            yield from _of_gradescope(item, metadata[item.name])
        elif match:
            canvas.setdefault(match["user"], []).append(_Download(item, match))
        elif item.is_dir() or item.name.lower().endswith((*SUFFIXES, *FOREIGN)):
            stem = stem_of(item)
            moodle = _MOODLE.fullmatch(stem)
            names = (moodle["name"] if moodle else stem,)
            row = Collected(shown(stem), path=submission_in(item), item=item, names=names)
            # Moodle names the folder, but the student the archive.
            yield row if moodle else row.at(of_name(item.name))
        else:
            why = "is neither a folder nor an archive, so it is left out"
            on_left_out(f"{shown(item.name)} {why}")
    for downloads in canvas.values():
        yield _of_canvas(downloads, staging)


class _Download(NamedTuple):
    """A file as Canvas lets a teacher download it, and what its name there says."""

    file: Path
    name: re.Match[str]


def _of_canvas(downloads: list[_Download], staging: Path) -> Collected:
    """What one student handed in, in one file or in several."""
    name = downloads[0].name
    files, note = _under_own_names(downloads)
    path, fault = only_archive(files), ""
    if path is None:
        path = staging / f"canvas-{name['user']}"
        fault = _gather(files, path)
    return Collected(
        shown(f"{name['name']}_{name['user']}"),
        late=any(download.name["late"] for download in downloads),
        fault=fault,
        path=None if fault else path,
        item=path,
        names=(name["user"], name["name"]),
        download=carrier([download.file.name for download in downloads]),
        problem=note,
    )


def _under_own_names(downloads: list[_Download]) -> tuple[dict[str, Path], str]:
    """Each file under the name that it was handed in with, as far as that tells them apart.

    Of an archive that was handed in several times (``ws.zip``, ``ws-1.zip``) only the last counts,
    and a note says so.
    """
    downloads = sorted(downloads, key=lambda download: int(download.name["attachment"]))
    times = Counter(_own_name(download) for download in downloads)
    files: dict[str, Path] = {}
    archives: dict[str, list[str]] = {}
    for download in downloads:
        own, given = _own_name(download), download.name["file"]
        is_archive = own.lower().endswith(SUFFIXES)
        files[own if is_archive or times[own] == 1 else given] = download.file
        if is_archive:
            archives.setdefault(own, []).append(given)
    notes = [
        f"{listing(names)} are taken for one archive that was handed in again: only the last counts"
        for names in archives.values()
        if len(names) > 1
    ]
    return files, shown("; ".join(notes))


def _own_name(download: _Download) -> str:
    """The name without what Canvas adds where a file is handed in again."""
    return _AGAIN.sub("", download.name["file"])


def _gather(files: Mapping[str, Path], folder: Path) -> str:
    """Copy files together into a new folder; return what went wrong, or nothing.

    Several archives, such as one of each package, are unpacked side by side.
    """
    most = ArchiveLimits().total_bytes
    try:
        if sum(file.lstat().st_size for file in files.values()) > most:
            return f"the files hold more than {most // MIB} MiB"
        folder.mkdir()
        for name, file in files.items():
            if not (name.lower().endswith(SUFFIXES) and _unpacked(file, folder / name)):
                shutil.copyfile(file, folder / name, follow_symlinks=False)
    except GraderFault as fault:
        return str(fault)
    except OSError as error:
        return f"the files cannot be read: {error.strerror or error}"
    return ""


def _unpacked(file: Path, folder: Path) -> bool:
    folder.mkdir()
    try:
        unpack(file, folder)
    except SubmissionError:
        shutil.rmtree(folder)
        return False
    return True


def _gradescope(file: Path) -> Mapping[str, Any]:
    if not file.is_file():
        return {}
    try:
        data = yaml.safe_load(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError, yaml.YAMLError) as error:
        # A ValueError: bytes that are no UTF-8, or a date that there is none of.
        raise UsageError(f"{file}: cannot be read: {error}") from error
    return data if isinstance(data, dict) else {}


def _of_gradescope(item: Path, about: Any) -> Iterator[Collected]:
    """An exported folder, for each of its team; Gradescope writes keys with a colon in front."""
    about = about if isinstance(about, dict) else {}
    submitters = about.get(":submitters")
    if not isinstance(submitters, list):
        submitters = []
    people = [person for person in submitters if isinstance(person, dict)]
    time = of_metadata(about)
    for person in people or [{}]:
        values = (person.get(field) for field in (":sid", ":email", ":name"))
        names = tuple(str(value) for value in values if value) or (item.name,)
        name, path = shown(str(person.get(":name") or "")), submission_in(item)
        yield Collected(shown(names[0]), name=name, path=path, item=item, names=names).at(time)
