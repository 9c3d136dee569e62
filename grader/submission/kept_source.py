"""The text files of a submission as they were handed in, kept beside its result to be read later.

What builds and runs left behind is not kept, and no symbolic link is followed.
"""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass, field
from pathlib import Path

from grader.submission.intake.listing import list_files
from grader.submission.intake.paths import shown

SOURCE_FOLDER = "source"
LARGEST_BYTES = 256 * 1024
MOST_BYTES = 4 * 1024 * 1024
MOST_FILES = 2000
_MOST_NAMED = 200
_LONGEST_PATH = 1024
# No file of a submission has such a path: see `leftovers.TOOL_FOLDERS`.
_LEFT_OUT = "rosgrade-report/left-out.txt"
# So that neither colcon nor rosgrade takes the copy for packages of the workspace around it.
_IGNORE = "COLCON_IGNORE"


@dataclass(frozen=True)
class KeptSource:
    """What can be read of a submission.

    Attributes:
        files: Texts by printable path, in order, with the newlines of Unix.
        left_out: Printable paths of what is no text, is a link, or was too much to keep.
    """

    files: dict[str, str] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()


def keep_source(root: Path, folder: Path) -> None:
    """Copy the text files of a submission into a folder, and name there what is left out.

    Args:
        root: The submission; must not change meanwhile.
        folder: Made for them; what was there is replaced.
    """
    shutil.rmtree(folder, ignore_errors=True)
    room, count, left_out = MOST_BYTES, 0, list[str]()
    # The smallest first: a table of data must not take the place of a program.
    for file in sorted(list_files(root), key=lambda one: (one.size, os.fsencode(one.path))):
        fits = file.size <= min(room, LARGEST_BYTES) and count < MOST_FILES
        plain = file.link is None and len(os.fsencode(file.path)) <= _LONGEST_PATH
        data = (root / file.path).read_bytes() if fits and plain else b"\0"
        if b"\0" in data:
            left_out.append(shown(file.path))
        else:
            _write(folder / file.path, data)
            room, count = room - len(data), count + 1
    _write(folder / _IGNORE, b"")
    if left_out:
        more = len(left_out[_MOST_NAMED:])
        named = [*sorted(left_out)[:_MOST_NAMED], *([f"… and {more} more"] if more else [])]
        _write(folder / _LEFT_OUT, "\n".join(named).encode())


def read_kept_source(folder: Path) -> KeptSource:
    """Read what :func:`keep_source` wrote; empty where nothing was kept."""
    found = {
        file.relative_to(folder).as_posix(): file
        for file in sorted(folder.rglob("*"))
        if file.is_file() and not file.is_symlink()
    }
    left_out = found.pop(_LEFT_OUT, None)
    found.pop(_IGNORE, None)
    return KeptSource(
        {shown(path): _text(file) for path, file in found.items()},
        tuple(_text(left_out).splitlines()) if left_out else (),
    )


def _write(file: Path, data: bytes) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(data)


def _text(file: Path) -> str:
    return file.read_text(encoding="utf-8-sig", errors="replace")
