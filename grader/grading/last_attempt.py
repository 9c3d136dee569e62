"""The ways of the robot in the attempt before, kept small, to be drawn beside the new ones."""

from __future__ import annotations

import json
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from grader.grading.graded import Graded
from grader.report.files import write_whole
from grader.report.html.replay import Replay, make_replay

EARLIER = "earlier"
_FILE = "replays.json"
# Of the world the new run has everything.
_EMPTY: Replay = {
    **{"walls": [], "lines": [], "moving": [], "touches": [], "log": [], "goals": []},
    **{"lidar": [0, 0, 0], "scans": None},
}


def keep_earlier(file: Path, content: str | None = None) -> None:
    """Keep a file with grades, or a shorter content of it, when another is about to replace it."""
    if file.is_file():
        stamp = datetime.fromtimestamp(file.stat().st_mtime, timezone.utc)
        kept = file.parent / EARLIER / f"{file.stem}-{stamp:%Y%m%dT%H%M%S.%fZ}{file.suffix}"
        write_whole(kept, file.read_bytes() if content is None else content)


def keep_replays(folder: Path, graded: Graded) -> None:
    """Keep the ways of a graded submission in the folder of its report, beside the ones before."""
    grade, sha256 = graded.grade, graded.grade.submission.sha256
    made = {
        scenario.id: make_replay(graded.recordings[scenario.id], scenario)
        for scenario in grade.assignment.scenarios
        if scenario.id in graded.recordings
    }
    replays = {name: {**replay, **_EMPTY} for name, replay in made.items() if replay}
    if replays:
        others = [one for one in _read(folder) if one["sha256"] != sha256]
        kept = [*others[-1:], {"sha256": sha256, "replays": replays}]
        write_whole(folder / EARLIER / _FILE, json.dumps(kept, separators=(",", ":")))


def replays_before(folder: Path, sha256: str) -> dict[str, Replay]:
    """Ways of the attempt before that of this hash by scenario; none where none are kept."""
    others = [one["replays"] for one in _read(folder) if one["sha256"] != sha256]
    return dict(others[-1]) if others else {}


def _read(folder: Path) -> list[dict[str, Any]]:
    try:
        found = json.loads((folder / EARLIER / _FILE).read_bytes())
        return [{"sha256": one["sha256"], "replays": dict(one["replays"])} for one in found]
    except (OSError, ValueError, KeyError, TypeError):
        # Missing or damaged: there is nothing to compare with.
        return []
