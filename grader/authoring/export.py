"""What a course uploads or copies so that another system runs rosgrade by itself."""

from __future__ import annotations

import io
import json
import re
import shutil
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from grader.assignment.load import LoadedAssignment
from grader.authoring.starter import rendered
from grader.authoring.visible_files import files_in, grading_files, visible_files
from grader.errors import UsageError
from grader.machine import resources
from grader.machine.bootstrap import APT, UNDERLAYS_FILE, UNDERLAYS_PLACE
from grader.report.files import refuse_inputs, refuse_part, write_whole
from grader.submission.underlay.portable import check_archive
from grader.submission.underlay.transfer import is_address

_CHECKOUT = ("pyproject.toml", "requirements.lock", "README.md", "LICENSE")
_FOLDERS = ("grader", "sim", "templates", "docs/concepts")
_OWN_FOLDER = "rosgrade"
# A zip holds no earlier date; with a fixed one the same files give the same bytes.
_DATE = (1980, 1, 1, 0, 0, 0)
_ACTION = re.compile(r"(\./\S+|[\w.-]+/[\w./-]+@[\w./-]+)")


@dataclass(frozen=True)
class Member:
    """A file of an export."""

    content: bytes
    executable: bool = False


def gradescope(loaded: LoadedAssignment, out: Path, underlays: str = "") -> Path:
    """Write the autograder that is uploaded to Gradescope.

    Args:
        underlays: What its set-up imports, see :func:`carried_underlays`.
    """
    members = {
        "setup.sh": _template("gradescope-setup.sh", loaded, executable=True),
        "run_autograder": _template("gradescope-run_autograder", loaded, executable=True),
        **_rosgrade(loaded, grading_files(loaded), underlays),
    }
    file = out / f"gradescope-{loaded.assignment.id}.zip"
    refuse_part(file, loaded.folder, f"the assignment in {loaded.folder}")
    write_whole(file, _zipped(members))
    return file


def classroom50(loaded: LoadedAssignment, out: Path, underlays: str = "") -> Path:
    """Write the folder that goes into a Classroom 50 classroom's ``autograders/``.

    Everybody who knows the classroom's address can read its files, so it holds no hidden check.

    Args:
        underlays: What its set-up imports, see :func:`carried_underlays`.
    """
    folder = out / f"classroom50-{loaded.assignment.id}"
    refuse_part(folder, loaded.folder, f"the assignment in {loaded.folder}")
    members = {
        "autograder.py": _template("classroom50-autograder.py", loaded),
        **_rosgrade(loaded, visible_files(loaded), underlays),
    }
    shutil.rmtree(folder, ignore_errors=True)
    write_members(folder, members)
    return folder


def github(loaded: LoadedAssignment, out: Path, action: str, tag: str = "") -> Path:
    """Write the workflow that goes into a template repository.

    An assignment that is not one of rosgrade's own is copied beside it, without its solution and
    its hidden checks.

    Args:
        tag: Pattern of the tags that are graded; every push if empty.
    """
    if not _ACTION.fullmatch(action):
        raise UsageError(
            f"{action!r} is no action: write OWNER/REPOSITORY@REF, such as my-course/rosgrade@v1"
        )
    refuse_inputs([out], [loaded.folder])
    name = loaded.assignment.id
    if loaded.folder.resolve().parent != resources.assignments().resolve():
        name = f".github/rosgrade/{loaded.assignment.id}"
        for inside, content in visible_files(loaded).items():
            write_whole(out / name / inside, content)
    file = out / ".github" / "workflows" / "rosgrade.yml"
    tags = f"\n    tags: [{json.dumps(tag)}]" if tag else ""
    values = {"assignment": name, "action": action, "tags": tags}
    write_whole(file, rendered("export/github-workflow.yml", **values))
    return file


def carried_underlays(place: str) -> dict[str, Member]:
    """The file that a set-up imports packages of ROS 2 from; none if nothing is named.

    Args:
        place: What ``rosgrade underlay export`` wrote, which is carried along, or the address where
            it lies, which is named.

    Raises:
        UsageError: It is not such a file or address.
    """
    if not place:
        return {}
    if is_address(place):
        return {UNDERLAYS_PLACE: Member(f"{place}\n".encode())}
    check_archive(Path(place))
    return {UNDERLAYS_FILE: Member(Path(place).read_bytes())}


def _rosgrade(
    loaded: LoadedAssignment, files: Mapping[str, bytes], underlays: str
) -> dict[str, Member]:
    members = {**checkout({loaded.assignment.id: files}), **carried_underlays(underlays)}
    return {f"{_OWN_FOLDER}/{name}": member for name, member in members.items()}


def checkout(assignments: Mapping[str, Mapping[str, bytes]]) -> dict[str, Member]:
    """A checkout of rosgrade with these assignments' files: what its own set-up needs."""
    root = resources.root()
    missing = [name for name in _CHECKOUT if not (root / name).is_file()]
    if missing:
        raise UsageError(
            "this needs a checkout of rosgrade, whose requirements.lock says exactly what to "
            f"install: there is no {', '.join(missing)} in {root}"
        )
    paths = {name: root / name for name in _CHECKOUT}
    for folder in _FOLDERS:
        for path in files_in(root / folder):
            paths[path.relative_to(root).as_posix()] = path
    members = {
        name: Member(path.read_bytes(), path.stat().st_mode & 0o100 != 0)
        for name, path in paths.items()
    }
    for assignment, files in assignments.items():
        for inside, content in files.items():
            members[f"assignments/{assignment}/{inside}"] = Member(content)
    return dict(sorted(members.items()))


def _template(name: str, loaded: LoadedAssignment, *, executable: bool = False) -> Member:
    text = rendered(f"export/{name}", assignment=loaded.assignment.id, apt=APT)
    return Member(text.encode(), executable)


def _zipped(members: Mapping[str, Member]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, member in members.items():
            info = zipfile.ZipInfo(name, _DATE)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = (0o100755 if member.executable else 0o100644) << 16
            archive.writestr(info, member.content)
    return stream.getvalue()


def write_members(folder: Path, members: Mapping[str, Member]) -> None:
    """Write the files of an export into a folder."""
    for name, member in members.items():
        write_whole(folder / name, member.content)
        if member.executable:
            (folder / name).chmod(0o755)
