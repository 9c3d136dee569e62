"""When something was handed in, and what tells it; never a guess from the times of files."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from grader.batch.collected import Collected
from grader.course.instant import read_time
from grader.errors import GraderFault, UsageError
from grader.submission.git import run_git
from grader.submission.intake.paths import shown

_COLUMNS = ("handed_in", "handed in", "submitted_at")
NOT_KNOWN = ("", "")
CANVAS_TIMES = "submissions*.json"
_IN_NAME = re.compile(
    r"(\d{4}-\d\d-\d\d)[T_ -](\d\d)[-:.](\d\d)(?:[-:.](\d\d))?(Z|\+\d\d:?\d\d|-\d\d:\d\d)?(?!\d)"
)
_COMMITTER = re.compile(r"^committer .*> (\d{1,11}) ([+-]\d{4})$", re.MULTILINE)
_GIT_LIMIT_S = 20.0


def timed(rows: Sequence[Collected], staging: Path) -> list[Collected]:
    """Rows with their times: the roster is asked first, then platform and names, then git."""
    return [_timed(row, staging) for row in rows]


def _timed(row: Collected, staging: Path) -> Collected:
    text = next((row.columns[name] for name in _COLUMNS if row.columns.get(name)), "")
    if text:
        try:
            row = row.at((_iso(text), "the roster"))
        except ValueError as error:
            row = row.with_problem(f"when it was handed in is not known: {error}")
    if row.path is not None and not row.handed_in:
        row = row.at(_of_commit(row.path, staging / "committed"))
    return row


def of_metadata(about: Mapping[str, Any]) -> tuple[str, str]:
    """When Gradescope's metadata says that it was handed in."""
    created = about.get(":created_at")
    text = created.isoformat() if isinstance(created, datetime) else ""
    return _valid(text, "Gradescope's metadata")


def of_canvas(
    folder: Path, beside: Path | None, on_left_out: Callable[[str], None]
) -> dict[str, tuple[str, str]]:
    """When Canvas says that each user handed in: what its API told, as the instructor kept it.

    ``beside`` is the folder around an archive, where files of anything else may lie too.
    """
    times: dict[str, tuple[str, str]] = {}
    folders = [folder] if beside is None else [folder, beside]
    for file in (file for place in folders for file in sorted(place.glob(CANVAS_TIMES))):
        try:
            times |= _read_canvas(file)
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            why = "is no list of submissions of Canvas"
            if file.parent != beside:
                raise UsageError(f"{file}: {why}: {error!r}") from error
            on_left_out(f"{shown(file.name)} {why}, so it is left out")
    return times


def _read_canvas(file: Path) -> dict[str, tuple[str, str]]:
    submissions = [one for one in json.loads(file.read_bytes()) if one.get("submitted_at")]
    return {str(one["user_id"]): (_iso(str(one["submitted_at"])), "Canvas") for one in submissions}


def of_name(name: str) -> tuple[str, str]:
    """A time in a name that the platform or the instructor gave, never one of the student's."""
    match = _IN_NAME.search(name)
    if match is None:
        return NOT_KNOWN
    day, hour, minute, second, offset = match.groups(default="")
    return _valid(f"{day}T{hour}:{minute}:{second or '00'}{offset}", "the name of the file")


def _of_commit(path: Path, ours: Path) -> tuple[str, str]:
    """The committer date of a repository's HEAD, by the clock of the machine that committed.

    git reads the student's objects from a repository of our own, so that it follows nothing that
    the student's configuration names.
    """
    git = path / ".git"
    if git.is_symlink() or not git.is_dir():
        return NOT_KNOWN
    try:
        for name in ("objects/info", "refs"):
            (ours / name).mkdir(parents=True, exist_ok=True)
        (ours / "HEAD").write_text("ref: refs/heads/main\n")
        (ours / "objects/info/alternates").write_text(f"{(git / 'objects').resolve()}\n")
        asked = ["--git-dir", str(git), "rev-parse", "--verify", "--end-of-options", "HEAD"]
        sha = run_git(asked, ours, _GIT_LIMIT_S).strip()
        commit = run_git(["--git-dir", str(ours), "cat-file", "commit", sha], ours, _GIT_LIMIT_S)
        seconds, zone = _COMMITTER.findall(commit.partition("\n\n")[0])[0]
        moment = datetime.fromtimestamp(int(seconds), datetime.strptime(zone, "%z").tzinfo)
    except (GraderFault, OSError, ValueError, IndexError, OverflowError):
        # An empty repository, or one that is damaged.
        return NOT_KNOWN
    return _valid(moment.isoformat(), f"the committer date of git commit {sha[:7]}")


def _valid(text: str, source: str) -> tuple[str, str]:
    """A time with its source; nothing where there is no such time."""
    try:
        return _iso(text), source
    except ValueError:
        return NOT_KNOWN


def _iso(text: str) -> str:
    return read_time(text).isoformat(timespec="seconds")
