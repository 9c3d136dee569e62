"""Who handed in what: from a folder, an archive or a roster to a row for each student."""

from __future__ import annotations

import os
import re
import shutil
import stat
import subprocess
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any

import yaml

from grader.batch.roster import Roster, Student, name_forms, resemblance, written
from grader.checks.wording import listing
from grader.errors import GraderFault, RosgradeError, SubmissionError, UsageError
from grader.submission.intake.archive import SUFFIXES, unpack
from grader.submission.intake.members import MIB, ArchiveLimits
from grader.submission.intake.paths import shown
from grader.submission.read.manifest import MANIFEST

GRADESCOPE_METADATA = "submission_metadata.yml"
# How Canvas names what it lets a teacher download: name, perhaps LATE, user, attachment, file.
_CANVAS = re.compile(
    r"(?P<name>[^_]+)_(?P<late>LATE_)?(?P<user>\d+)_(?P<attachment>\d+)_(?P<file>.+)", re.DOTALL
)
# And Moodle, for a folder of each student or for a single file.
_MOODLE = re.compile(r"(?P<name>[^_]+)_\d+_assignsubmission_file_.*", re.DOTALL)
# What Canvas adds to the name of a file that was handed in again: ws-1.zip.
_AGAIN = re.compile(r"-\d+(?=(\.tar)?\.[^.]+$)")
_IGNORED = ("__MACOSX",)
# Archives that cannot be read: whoever handed one in is told so, and has a row.
_FOREIGN = (".rar", ".7z")
_REPOSITORY = re.compile(r"(https?|ssh|git|file)://|[\w.-]+@[\w.-]+:")
_CLONE_LIMIT_S = 120.0
_BARE = "is a bare git repository; give a clone of it, or name it as file://… in a roster"
# No name of a repository has so many in earnest.
_MOST_HYPHENS = 12
_MOST_TWICE = 10
# A class's archive holds what many students handed in.
_CLASS_LIMITS = ArchiveLimits(total_bytes=8192 * MIB, members=500_000)


@dataclass(frozen=True)
class HandedIn:
    """A row of the class.

    Attributes:
        key: What the student is called in results; unique.
        path: What was handed in, or None for nothing; those of a team have the same.
        name: The student's, as people write it, or empty.
        problem: Why there is nothing to grade, or what the instructor should look at.
    """

    key: str
    path: Path | None
    name: str = ""
    late: bool = False
    problem: str = ""
    fault: str = ""


@dataclass(frozen=True)
class _Entry:
    """Something in the folder, with the names that it has for its author."""

    key: str
    path: Path
    names: tuple[str, ...]
    name: str = ""
    late: bool = False
    fault: str = ""


def take_in(
    source: Path,
    staging: Path,
    roster: Roster | None = None,
    on_left_out: Callable[[str], None] = lambda _: None,
    out: Path | None = None,
    on_prefix: Callable[[str], None] = lambda _: None,
) -> list[HandedIn]:
    """Find out who handed in what.

    Args:
        source: A folder of folders and archives, as a learning platform gives it, or an archive
            of such a folder.
        staging: An empty folder for what has to be unpacked, copied together or cloned.
        roster: Who should have handed in; without one everybody who did is a row.
        out: Folder of the results; in ``source`` it is no submission.
        on_prefix: Told what all names of repositories begin with, where what follows is taken
            for a login of the roster.

    Returns:
        The rows, sorted by key; those of the roster that handed in nothing are among them.

    Raises:
        UsageError: There is nothing, or it is one submission and not a folder of them.
    """
    folder = _opened(source, staging)
    _refuse_single(folder, source)
    entries = list(_entries(folder, staging, on_left_out, out))
    if not entries:
        raise UsageError(f"{source}: holds no submission; expected a folder or an archive of each")
    if roster is None:
        return _unique([_row(item) for item in entries])
    return _unique(_matched(entries, roster, on_prefix))


def take_in_roster(
    roster: Roster, base: Path, staging: Path, on_taken: Callable[[str], None] = lambda _: None
) -> list[HandedIn]:
    """Take in what a roster itself names, as paths or URLs of git repositories.

    Args:
        base: Folder that its paths are relative to.
        staging: An empty folder for clones.

    Raises:
        UsageError: No row names a submission.
    """
    if not any(student.submission for student in roster.students):
        raise UsageError(
            "the roster names no submissions; give it a column `submission` with paths or URLs, "
            "or name the folder of submissions"
        )
    rows = []
    # What a team names is fetched once.
    cloned: dict[str, HandedIn] = {}
    for student in roster.students:
        row = _from_roster(student, base, staging, cloned.get(student.submission))
        rows.append(row)
        if _REPOSITORY.match(student.submission):
            cloned.setdefault(student.submission, row)
        on_taken(student.key)
    return _unique(rows)


def _from_roster(student: Student, base: Path, staging: Path, cloned: HandedIn | None) -> HandedIn:
    row = HandedIn(student.key, None, student.name, problem=student.problem)
    if not student.submission:
        return _with_problem(row, "handed in nothing")
    if cloned is not None:
        return replace(row, path=cloned.path, fault=cloned.fault)
    if _REPOSITORY.match(student.submission):
        target = staging / f"clone-{student.row}"
        problem = _clone(student.submission, target)
        return replace(row, fault=problem) if problem else replace(row, path=target)
    path = base / student.submission
    try:
        path.stat()
        fault = _BARE if _is_bare(path) else ""
    except (FileNotFoundError, ValueError):
        # A ValueError where no file can have that name: there is a NUL in it.
        fault = f"{shown(str(path))} does not exist"
    except OSError as error:
        fault = f"{shown(student.submission)} cannot be read: {error.strerror}"
    return replace(row, fault=fault) if fault else replace(row, path=path)


def _clone(url: str, target: Path) -> str:
    """Clone a repository; says what went wrong, or nothing."""
    options = ["--quiet", "--depth", "1", "--no-recurse-submodules"]
    try:
        _git("clone", *options, "--", url, str(target))
        if _git("-C", str(target), "for-each-ref", "--count=1"):
            return ""
        # Git takes a HEAD that names no branch for an empty repository: after a push of `main` to
        # where HEAD is `master`, nobody may be told to have handed in nothing.
        heads = _git("ls-remote", "--heads", "--", url).split("\n")
        branches = [head.partition("refs/heads/")[2] for head in heads if head]
        if len(branches) == 1:
            shutil.rmtree(target)
            _git("clone", *options, f"--branch={branches[0]}", "--", url, str(target))
    except FileNotFoundError:
        return "git is not installed"
    except subprocess.TimeoutExpired:
        return f"git clone took longer than {_CLONE_LIMIT_S:.0f} s"
    except subprocess.CalledProcessError as error:
        # Below its reason git says what one might look at.
        lines = error.stderr.strip().split("\n")
        reason = next((line for line in lines if line.startswith("fatal: ")), lines[-1])
        return f"git clone failed: {shown(reason.removeprefix('fatal: '))}"
    if len(branches) > 1:
        names = shown(", ".join(branches))
        return f"HEAD of the repository names none of its branches, which are {names}"
    return ""


def _git(*arguments: str) -> str:
    """Run git, which asks for nothing and runs nothing of the repository; gives its output.

    Raises:
        FileNotFoundError: Git is not installed.
        TimeoutExpired: It took too long.
        CalledProcessError: It failed.
    """
    done = subprocess.run(
        ["git", "-c", "core.hooksPath=/dev/null", "-c", "protocol.ext.allow=never", *arguments],
        # What it says is looked for words.
        env={**os.environ, "GIT_TERMINAL_PROMPT": "0", "GIT_LFS_SKIP_SMUDGE": "1", "LC_ALL": "C"},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        errors="replace",
        timeout=_CLONE_LIMIT_S,
        check=True,
    )
    return done.stdout


def _is_bare(path: Path) -> bool:
    """Whether it is a repository without its files: what git itself looks for."""
    try:
        return all((path / part).exists() for part in ("HEAD", "objects", "refs"))
    except OSError:
        # Why it cannot be read is told by whoever reads it.
        return False


def _opened(source: Path, staging: Path) -> Path:
    if source.is_dir():
        return _export_in(source) or source
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
    # An archive of a folder holds that folder alone.
    inside = [item for item in target.iterdir() if not _is_ignored(item)]
    alone = len(inside) == 1 and inside[0].is_dir() and _manifest_of_one(inside[0]) is None
    return inside[0] if alone else target


def _export_in(folder: Path) -> Path | None:
    """The folder of Gradescope's export where there is nothing else, as unpacking may leave it."""
    inside = [item for item in folder.iterdir() if not _is_ignored(item)]
    if len(inside) == 1 and (inside[0] / GRADESCOPE_METADATA).is_file():
        return inside[0]
    return None


def _refuse_single(folder: Path, source: Path) -> None:
    found = _manifest_of_one(folder)
    if found is not None:
        raise UsageError(
            f"{source}: looks like one submission ({shown(str(found))} is in it); name the folder "
            "that holds those of the class, or use `rosgrade check`"
        )


def _manifest_of_one(folder: Path) -> Path | None:
    """The package.xml by which a folder looks like one submission, relative to it; or None."""
    found = [folder / MANIFEST, *sorted((folder / "src").glob(f"*/{MANIFEST}"))]
    return next((file.relative_to(folder) for file in found if file.is_file()), None)


def _is_ignored(item: Path) -> bool:
    return item.name.startswith(".") or item.name in _IGNORED


def _entries(
    folder: Path, staging: Path, on_left_out: Callable[[str], None], out: Path | None
) -> Iterator[_Entry]:
    metadata = _gradescope(folder / GRADESCOPE_METADATA)
    canvas: dict[str, list[tuple[Path, re.Match[str]]]] = {}
    for item in sorted(folder.iterdir(), key=lambda path: os.fsencode(path.name)):
        if _is_ignored(item) or item.name == GRADESCOPE_METADATA:
            continue
        # Path.resolve() raises at a link that leads to itself.
        if out is not None and os.path.realpath(item) == os.path.realpath(out):
            continue
        match = _CANVAS.fullmatch(item.name) if item.is_file() else None
        if item.name in metadata:
            yield from _of_gradescope(item, metadata[item.name])
        elif match:
            canvas.setdefault(match["user"], []).append((item, match))
        elif item.is_dir() or item.name.lower().endswith((*SUFFIXES, *_FOREIGN)):
            stem = _stem(item)
            moodle = _MOODLE.fullmatch(stem)
            yield _Entry(shown(stem), item, (moodle["name"] if moodle else stem,))
        else:
            on_left_out(shown(item.name))
    for files in canvas.values():
        yield _of_canvas(files, staging)


def _stem(item: Path) -> str:
    known = (*SUFFIXES, *_FOREIGN)
    suffix = next((s for s in known if item.is_file() and item.name.lower().endswith(s)), "")
    return item.name[: len(item.name) - len(suffix)] or item.name


def _of_canvas(files: list[tuple[Path, re.Match[str]]], staging: Path) -> _Entry:
    """One student's files: the only one, or all of them in a folder."""
    match = files[0][1]
    named = _names(files)
    path, fault = _only_archive(named), ""
    if path is None:
        path = staging / f"canvas-{match['user']}"
        fault = _gather(named, path)
    late = any(one["late"] for _, one in files)
    return _Entry(
        shown(f"{match['name']}_{match['user']}"),
        path,
        (match["user"], match["name"]),
        late=late,
        fault=fault,
    )


def _names(files: list[tuple[Path, re.Match[str]]]) -> dict[str, Path]:
    """Each file under the name that it was handed in with, as far as that tells them apart."""
    plain = [_AGAIN.sub("", named["file"]) for _, named in files]
    names = {
        name if plain.count(name) == 1 else named["file"]: file
        for name, (file, named) in zip(plain, files, strict=True)
    }
    # The same name twice, which Canvas does not give: nothing of it may be lost.
    return names if len(names) == len(files) else {file.name: file for file, _ in files}


def _only_archive(files: Mapping[str, Path]) -> Path | None:
    """The archive that somebody handed in, perhaps with a report beside it; else None."""
    archives = [file for name, file in files.items() if name.lower().endswith(SUFFIXES)]
    # A link may lead to somebody else's.
    plain = all(stat.S_ISREG(file.lstat().st_mode) for file in files.values())
    return archives[0] if len(archives) == 1 and plain and MANIFEST not in files else None


def _gather(files: Mapping[str, Path], folder: Path) -> str:
    """Copy files together into a new folder; says what went wrong, or nothing.

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
    """Unpack an archive into a new folder; whether it is one."""
    folder.mkdir()
    try:
        unpack(file, folder)
    except SubmissionError:
        shutil.rmtree(folder)
        return False
    return True


def _gradescope(file: Path) -> Mapping[str, Any]:
    """What Gradescope's export says of each submission, by folder."""
    if not file.is_file():
        return {}
    try:
        data = yaml.safe_load(file.read_text(encoding="utf-8"))
    except RecursionError as error:
        raise UsageError(f"{file}: cannot be read: lists in lists in lists, too deep") from error
    except (OSError, ValueError, yaml.YAMLError) as error:
        # A ValueError: bytes that are no UTF-8, or a date that there is none of.
        raise UsageError(f"{file}: cannot be read: {error}") from error
    return data if isinstance(data, dict) else {}


def _of_gradescope(item: Path, about: Any) -> Iterator[_Entry]:
    """An exported folder, for each of its team; Gradescope writes keys with a colon in front."""
    submitters = about.get(":submitters") if isinstance(about, dict) else None
    listed = submitters if isinstance(submitters, list) else []
    people = [person for person in listed if isinstance(person, dict)]
    for person in people or [{}]:
        told = (person.get(field) for field in (":sid", ":email", ":name"))
        names = tuple(str(value) for value in told if value) or (item.name,)
        yield _Entry(shown(names[0]), item, names, shown(str(person.get(":name") or "")))


def _row(entry: _Entry) -> HandedIn:
    fault = entry.fault or (_BARE if _is_bare(entry.path) else "")
    path = None if fault else _archive_in(entry.path) or entry.path
    return HandedIn(entry.key, path, entry.name, entry.late, fault=fault)


def _archive_in(folder: Path) -> Path | None:
    """What was handed in where a platform has made a folder for it, as Moodle does, or None."""
    try:
        inside = list(folder.iterdir()) if folder.is_dir() else []
        # What a student has in a repository is as they meant it.
        if any(item.name == ".git" for item in inside):
            return None
        return _only_archive({item.name: item for item in inside if not _is_ignored(item)})
    except OSError:
        # Why it cannot be read is told by whoever reads it.
        return None


def _with_problem(row: HandedIn, problem: str) -> HandedIn:
    return replace(row, problem="; ".join(part for part in (problem, row.problem) if part))


class _Names:
    """Who of a roster a name names.

    Attributes:
        prefix: What stands before the login in the names of repositories, or empty.
    """

    def __init__(self, students: Sequence[Student], entries: Sequence[_Entry]) -> None:
        """Learn the names of a class."""
        self._alike: dict[str, list[Student]] = {}
        for student in students:
            for form in student.resembling:
                self._alike.setdefault(form, []).append(student)
        self.prefix = self._find_prefix([_stem(entry.path) for entry in entries])

    def _find_prefix(self, stems: Sequence[str]) -> str:
        """GitHub Classroom's ``<assignment>-``, where both that and logins may hold hyphens.

        It is what most of the names share; where they share several, logins of the roster must
        stand behind only one of them, more than once.
        """
        known: dict[str, int] = {}
        shared: Counter[str] = Counter()
        for stem in stems:
            parts = stem.split("-")[:_MOST_HYPHENS]
            for end in range(1, len(parts)):
                prefix = "-".join(parts[:end]) + "-"
                shared[prefix] += 1
                if self._by_login(stem[len(prefix) :]):
                    known[prefix] = known.get(prefix, 0) + 1
        most = max(shared.values(), default=0)
        found = [prefix for prefix, count in shared.items() if count == most > 1]
        if most <= len(stems) / 2:
            return ""
        fitting = [prefix for prefix in found if prefix in known]
        if len(fitting) != 1 or (len(found) > 1 and known[fitting[0]] == 1):
            return ""
        return fitting[0]

    def exact(self, entry: _Entry) -> set[str]:
        """Students whom its names name; several where two of its names contradict each other."""
        keys: set[str] = set()
        for name in entry.names:
            found = {
                student.key
                for form in name_forms(name)
                for student in self._alike.get(resemblance(form), ())
                if written(form) in student.logins or written(form) in student.names
            }
            keys = keys & found or keys | found
        if keys:
            return keys
        stem = _stem(entry.path)
        if self.prefix and stem.startswith(self.prefix):
            return self._by_login(stem.removeprefix(self.prefix))
        return set()

    def alike(self, entry: _Entry) -> set[str]:
        """Students whom it may be of: their name is written alike, or its name ends with it."""
        parts = _stem(entry.path).split("-")[-_MOST_HYPHENS:]
        ends = ["-".join(parts[first:]) for first in range(1, len(parts))]
        forms = map(resemblance, (*entry.names, *ends))
        return {student.key for form in forms for student in self._alike.get(form, ())}

    def _by_login(self, login: str) -> set[str]:
        alike = self._alike.get(resemblance(login), ())
        return {student.key for student in alike if written(login) in student.logins}


def _matched(
    entries: list[_Entry], roster: Roster, on_prefix: Callable[[str], None]
) -> list[HandedIn]:
    """Give each entry to the student of the roster that it names.

    What only resembles a name is given to nobody, and is told on its own row and on theirs.
    """
    names = _Names(roster.students, entries)
    if names.prefix:
        on_prefix(names.prefix)
    named: dict[str, set[str]] = {}
    students = {student.key: student for student in roster.students}
    for student in roster.students:
        if student.submission:
            file = PurePosixPath(student.submission).name.removesuffix(".git")
            named.setdefault(file, set()).add(student.key)
    rows: list[HandedIn] = []
    handed: dict[str, list[tuple[int, str]]] = {}
    doubtful: dict[str, list[str]] = {}
    given: set[Path] = set()
    for entry in entries:
        # What the roster says itself needs no guess, and a team may have handed in one for all.
        told = named.get(entry.path.name, set()) | named.get(_stem(entry.path), set())
        if told and entry.path in given:
            # Gradescope's export names a team too; the roster has named all of it already.
            continue
        given.add(entry.path)
        keys = told or names.exact(entry)
        if not told and len(keys) != 1:
            may_be = sorted(keys or names.alike(entry))
            for key in may_be:
                doubtful.setdefault(key, []).append(shown(entry.path.name))
            parts = ["" if keys else "not in the roster"]
            parts.append(f"may be {listing(may_be, 'or')}" if may_be else "")
            rows.append(replace(_row(entry), problem="; ".join(filter(None, parts))))
            continue
        for key in sorted(keys):
            student = students[key]
            handed.setdefault(key, []).append((len(rows), shown(entry.path.name)))
            row = replace(_row(entry), key=key, name=student.name, problem=student.problem)
            rows.append(row)
    for key, found in handed.items():
        for at, file in found if len(found) > 1 else ():
            others = [other for _, other in found[:_MOST_TWICE] if other != file] or [file]
            rows[at] = _with_problem(rows[at], f"handed in twice: {listing(others)} too")
        for at, _ in found if key in doubtful else ():
            rows[at] = _with_problem(rows[at], f"{listing(doubtful[key])} may be theirs too")
    missing = [_missing(student) for student in roster.students if student.key not in handed]
    return rows + [
        replace(row, problem=f"{row.problem}; {listing(doubtful[row.key])} may be theirs")
        if row.key in doubtful
        else row
        for row in missing
    ]


def _missing(student: Student) -> HandedIn:
    why = "handed in nothing"
    if student.submission:
        why += f": {shown(student.submission)} is not among the submissions"
    return _with_problem(HandedIn(student.key, None, student.name, problem=student.problem), why)


def _unique(rows: list[HandedIn]) -> list[HandedIn]:
    """Rows sorted by key, with a number behind a key that is there already."""
    # A browser numbers what it saves in the same way, so `ana (2)` may be there as well.
    taken = {row.key for row in rows}
    counts: dict[str, int] = {}
    found = []
    for row in sorted(rows, key=lambda item: item.key):
        key, number = row.key, counts.get(row.key, 0) + 1
        while number > 1 and (key := f"{row.key} ({number})") in taken:
            number += 1
        counts[row.key] = number
        taken.add(key)
        found.append(replace(row, key=key))
    return found
