"""What a course uploads or copies so that another system runs rosgrade by itself."""

from __future__ import annotations

import io
import re
import shutil
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from grader import resources
from grader.assignment.load import LoadedAssignment
from grader.assignment.mutant import LANGUAGES
from grader.assignment.selection import visible_part
from grader.errors import UsageError
from grader.report.files import refuse_inputs, refuse_part, write_whole

_CHECKOUT = ("pyproject.toml", "requirements.lock", "README.md", "LICENSE")
_PACKAGES = ("grader", "sim", "templates")
_OWN_FOLDER = "rosgrade"
# A zip holds no earlier date; with a fixed one the same files give the same bytes.
_DATE = (1980, 1, 1, 0, 0, 0)
_ACTION = re.compile(r"(\./\S+|[\w.-]+/[\w./-]+@[\w./-]+)")


@dataclass(frozen=True)
class Member:
    """A file of an export."""

    content: bytes
    executable: bool = False


def gradescope(loaded: LoadedAssignment, out: Path) -> Path:
    """Write the autograder that is uploaded to Gradescope."""
    members = {
        "setup.sh": _template("gradescope-setup.sh", loaded, executable=True),
        "run_autograder": _template("gradescope-run_autograder", loaded, executable=True),
        **_rosgrade(loaded),
    }
    file = out / f"gradescope-{loaded.assignment.id}.zip"
    refuse_part(file, loaded.folder, f"the assignment in {loaded.folder}")
    write_whole(file, _zipped(members))
    return file


def classroom50(loaded: LoadedAssignment, out: Path) -> Path:
    """Write the folder that goes into a Classroom 50 classroom's ``autograders/``.

    Everybody who knows the classroom's address can read its files, so it holds no hidden check.
    """
    _refuse_hidden(loaded, "everybody can read the files of a Classroom 50 autograder")
    folder = out / f"classroom50-{loaded.assignment.id}"
    refuse_part(folder, loaded.folder, f"the assignment in {loaded.folder}")
    members = {
        "autograder.py": _template("classroom50-autograder.py", loaded),
        **_rosgrade(loaded),
    }
    shutil.rmtree(folder, ignore_errors=True)
    _write_members(folder, members)
    return folder


def github(loaded: LoadedAssignment, out: Path, action: str) -> Path:
    """Write the workflow that goes into a template repository.

    An assignment that is not one of rosgrade's own is copied beside it, without its solution.
    """
    if not _ACTION.fullmatch(action):
        raise UsageError(
            f"{action!r} is no action: write OWNER/REPOSITORY@REF, such as my-course/rosgrade@v1"
        )
    refuse_inputs([out], [loaded.folder])
    name = loaded.assignment.id
    if loaded.folder.resolve().parent != resources.assignments().resolve():
        _refuse_hidden(loaded, "students can read the files of their repository")
        name = f".github/rosgrade/{loaded.assignment.id}"
        for inside, path in _assignment(loaded).items():
            write_whole(out / name / inside, path.read_bytes())
    text = _read_template("github-workflow.yml", name)
    file = out / ".github" / "workflows" / "rosgrade.yml"
    write_whole(file, text.replace("@ACTION@", action))
    return file


def _refuse_hidden(loaded: LoadedAssignment, why: str) -> None:
    hidden = visible_part(loaded).withheld.checks
    if hidden:
        raise UsageError(
            f"the assignment {loaded.assignment.id!r} has checks that are not visible ({hidden}), "
            f"and {why}: export a copy without them, and grade with them yourself"
        )


def _rosgrade(loaded: LoadedAssignment) -> dict[str, Member]:
    """A checkout of rosgrade with one assignment: what its own set-up needs."""
    root = resources.root()
    missing = [name for name in _CHECKOUT if not (root / name).is_file()]
    if missing:
        raise UsageError(
            "this needs a checkout of rosgrade, whose requirements.lock says exactly what to "
            f"install: there is no {', '.join(missing)} in {root}"
        )
    paths = {name: root / name for name in _CHECKOUT}
    for package in _PACKAGES:
        for path in _files(root / package):
            paths[path.relative_to(root).as_posix()] = path
    for inside, path in _assignment(loaded).items():
        paths[f"assignments/{loaded.assignment.id}/{inside}"] = path
    return {
        f"{_OWN_FOLDER}/{name}": Member(path.read_bytes(), path.stat().st_mode & 0o100 != 0)
        for name, path in sorted(paths.items())
    }


def _assignment(loaded: LoadedAssignment) -> dict[str, Path]:
    """The files of an assignment that grading needs: without its solution and its mutants."""
    solutions = {name for one in LANGUAGES for name in (one.mutants, one.reference)}
    found = {path.relative_to(loaded.folder): path for path in _files(loaded.folder)}
    return {
        inside.as_posix(): path
        for inside, path in found.items()
        if inside.parts[0] not in solutions
    }


def _files(folder: Path) -> Iterator[Path]:
    """Every file in a folder, without caches and hidden ones, sorted."""
    for path in sorted(folder.rglob("*")):
        inside = path.relative_to(folder).parts
        ignored = any(part.startswith(".") or part == "__pycache__" for part in inside)
        if path.is_file() and not ignored:
            yield path


def _template(name: str, loaded: LoadedAssignment, *, executable: bool = False) -> Member:
    return Member(_read_template(name, loaded.assignment.id).encode(), executable)


def _read_template(name: str, assignment: str) -> str:
    text = (resources.templates() / "export" / name).read_text(encoding="utf-8")
    return text.replace("@ASSIGNMENT@", assignment)


def _zipped(members: Mapping[str, Member]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, member in members.items():
            info = zipfile.ZipInfo(name, _DATE)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = (0o100755 if member.executable else 0o100644) << 16
            archive.writestr(info, member.content)
    return stream.getvalue()


def _write_members(folder: Path, members: Mapping[str, Member]) -> None:
    for name, member in members.items():
        write_whole(folder / name, member.content)
        if member.executable:
            (folder / name).chmod(0o755)
