"""What an instructor gives to a class: rosgrade and the assignments, as students may have them.

No file of it, also in the wheel, holds a solution, a mutant or a hidden check.
"""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import distributions
from pathlib import Path

from grader.assignment.load import LoadedAssignment, load_assignment
from grader.assignment.selection import visible_part
from grader.authoring.export import Member, carried_underlays, checkout, write_members
from grader.authoring.starter import rendered
from grader.authoring.visible_files import visible_files
from grader.errors import AssignmentError, UsageError
from grader.machine import resources
from grader.machine.bootstrap import (
    APT,
    DISTRO,
    UNDERLAYS_FILE,
    UNDERLAYS_PLACE,
    WHEELS_PLATFORM,
    read_lock,
)
from grader.report.files import refuse_part
from grader.report.html.handout import make_handout

_LOCK = "requirements.lock"
_ASSIGNMENTS = "assignments"
_RENDERED = {
    "README.md": "README.md",
    "setup.sh": "setup.sh",
    ".gitignore": "gitignore",
    ".github/workflows/grade.yml": "workflow.yml",
    ".devcontainer/devcontainer.json": "devcontainer.json",
    ".devcontainer/Dockerfile": "Dockerfile",
}
"""Path in the kit -> template."""


def write_kit(
    chosen: Sequence[LoadedAssignment], out: Path, title: str, tag: str = "", underlays: str = ""
) -> Path:
    """Write a course kit into a new folder, or renew the one that is there.

    Args:
        title: The course's name.
        tag: Pattern of the tags that the workflow grades; every push if empty.
        underlays: What its set-up imports, see
            :func:`~grader.authoring.export.carried_underlays`.
    """
    for loaded in chosen:
        refuse_part(out, loaded.folder, f"the assignment in {loaded.folder}")
        refuse_part(loaded.folder, out, f"the folder of the kit, {out}")
    old = sorted(out.glob("rosgrade-*.whl"))
    if not old and out.is_dir() and any(out.iterdir()):
        raise UsageError(f"{out}: is neither empty nor an earlier kit; name a new folder")
    files = {loaded.assignment.id: visible_files(loaded) for loaded in chosen}
    if len(files) < len(chosen):
        raise UsageError("two of the assignments have one id: give each once")
    with tempfile.TemporaryDirectory() as folder:
        wheel = _build_wheel(checkout(files), Path(folder), files)
        members = {wheel.name: Member(wheel.read_bytes()), _LOCK: Member(_runtime_lock(wheel))}
    members |= carried_underlays(underlays)
    values = {
        "title": title,
        "tag": tag,
        "handouts": [make_handout(visible_part(loaded)) for loaded in chosen],
        "hidden": any(visible_part(loaded).withheld.checks for loaded in chosen),
        "distro": DISTRO,
        "apt": APT,
        "underlays": bool(underlays),
        "platform": WHEELS_PLATFORM.removeprefix("linux-"),
    }
    for path, template in _RENDERED.items():
        text = rendered(f"course/{template}", **values)
        members[path] = Member(text.encode(), executable=path.endswith(".sh"))
    for assignment, content in files.items():
        for inside, data in content.items():
            members[f"{_ASSIGNMENTS}/{assignment}/{inside}"] = Member(data)
    for file in (*old, out / UNDERLAYS_FILE, out / UNDERLAYS_PLACE):
        file.unlink(missing_ok=True)
    shutil.rmtree(out / _ASSIGNMENTS, ignore_errors=True)
    write_members(out, members)
    return out


def _build_wheel(sources: Mapping[str, Member], folder: Path, assignments: Iterable[str]) -> Path:
    """Build rosgrade with nothing but these sources, in an empty folder."""
    try:
        from hatchling.builders.wheel import WheelBuilder
    except ImportError as error:
        raise UsageError("this needs hatchling, which `make setup` installs") from error
    write_members(folder, sources)
    for name in assignments:
        try:
            load_assignment(folder / _ASSIGNMENTS / name)
        except AssignmentError as error:
            problems = "; ".join(map(str, error.problems))
            raise UsageError(
                f"the assignment {name!r} does not work without its hidden checks: {problems}"
            ) from error
    (built,) = WheelBuilder(str(folder)).build(directory=str(folder), versions=["standard"])
    return Path(built)


def _runtime_lock(wheel: Path) -> bytes:
    """The part of rosgrade's lock that students need: rosgrade's requirements, ROS, and theirs."""
    (built,) = distributions(path=[str(wheel)])
    needed = set()
    for requirement in built.requires or []:
        extra = re.search(r"extra == '(\w+)'", requirement)
        if extra is None or extra[1] == "ros":
            name = re.split(r"[^\w.-]", requirement)[0]
            needed.add(re.sub(r"[._-]+", "-", name).lower())
    entries = read_lock((resources.root() / _LOCK).read_text(encoding="utf-8"))
    count = 0
    # What is needed by something that is needed, until there is no more of it.
    while len(needed) > count:
        count = len(needed)
        needed |= {entry.name for entry in entries if entry.parents & needed}
    return "".join(entry.text for entry in entries if entry.name in needed).encode()
