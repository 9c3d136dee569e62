"""The reference's own runs, recorded once and shipped beside the assignment.

``assignments/<id>/reference.json.gz`` holds a replay of each scenario with a robot, so that a
student sees the own run and a right one side by side.
"""

from __future__ import annotations

import gzip
import hashlib
import json
import math
import zlib
from collections.abc import Mapping
from itertools import accumulate
from pathlib import Path
from typing import Any

from grader.assignment.load import LoadedAssignment
from grader.assignment.model import Scenario
from grader.checks.wording import counted
from grader.errors import AssignmentError, Problem, UsageError
from grader.grade import Grade
from grader.measure.motion.quantities import metres
from grader.recording.model import Recording
from grader.report.files import write_whole
from grader.report.html.replay import Replay, make_replay

REFERENCE_FILE = "reference.json.gz"
SCHEMA = 1


def read_references(loaded: LoadedAssignment) -> dict[str, Replay]:
    """Replays of the reference by scenario id.

    A scenario that has changed since is left out: its run would mislead.

    Args:
        loaded: The assignment; it need not have such a file.

    Raises:
        AssignmentError: The file is damaged.
    """
    found = _read(loaded.folder / REFERENCE_FILE)
    return {
        scenario.id: found[scenario.id]["replay"]
        for scenario in loaded.assignment.scenarios
        if scenario.id in found and found[scenario.id]["of"] == fingerprint(loaded, scenario)
    }


def stale(loaded: LoadedAssignment) -> tuple[str, ...]:
    """Ids of the scenarios with a robot whose reference must be recorded again."""
    fresh = read_references(loaded)
    return tuple(
        scenario.id
        for scenario in loaded.assignment.scenarios
        if scenario.world is not None and scenario.id not in fresh
    )


def keep_reference(
    loaded: LoadedAssignment, grade: Grade, recordings: Mapping[str, Recording]
) -> str:
    """Keep the runs of the reference, and say how far they are from those kept before.

    Raises:
        UsageError: The reference lost points: nothing is kept.
    """
    name = loaded.assignment.id
    if not grade.full_points:
        raise UsageError(f"{name}: the reference does not get full points, so no run is kept")
    before = read_references(loaded)
    file = write_references(loaded, recordings)
    if file is None:
        return f"{name}: no scenario with a robot, nothing to keep"
    after = read_references(loaded)
    apart = {one: farthest_m(before[one], after[one]) for one in after if one in before}
    text = f"{name}: {counted(len(after), 'run')} of the reference kept in {file}"
    if apart:
        scenario = max(apart, key=lambda one: apart[one])
        text += f"; at most {metres(apart[scenario])} from those kept before (scenario {scenario})"
    return text


def write_references(loaded: LoadedAssignment, recordings: Mapping[str, Recording]) -> Path | None:
    """Write the file of an assignment.

    Returns:
        The file, or None where no scenario has a robot.
    """
    runs = {
        scenario.id: {"of": fingerprint(loaded, scenario), "replay": replay}
        for scenario in loaded.assignment.scenarios
        if scenario.id in recordings
        and (replay := make_replay(recordings[scenario.id], scenario)) is not None
    }
    if not runs:
        return None
    text = json.dumps({"schema": SCHEMA, "scenarios": runs}, separators=(",", ":"), sort_keys=True)
    file = loaded.folder / REFERENCE_FILE
    # Without the time of writing, so that the same runs are the same bytes.
    write_whole(file, gzip.compress(text.encode(), mtime=0))
    return file


def fingerprint(loaded: LoadedAssignment, scenario: Scenario) -> str:
    """What a run depends on, as a hash: the scenario as it is read, and its world."""
    said = scenario.model_dump_json(exclude_defaults=True, exclude={"title"})
    digest = hashlib.sha256(said.encode())
    if scenario.world is not None:
        digest.update((loaded.folder / scenario.world).read_bytes())
    return digest.hexdigest()[:16]


def farthest_m(one: Replay, other: Replay) -> float:
    """How far apart two runs of a scenario are at most, at the same time, in metres.

    The longer of the two is compared as far as the shorter goes.
    """
    positions = [
        zip(accumulate(replay["x"]), accumulate(replay["y"]), strict=True)
        for replay in (one, other)
    ]
    return max(
        (math.dist(a, b) / 1e3 for a, b in zip(*positions, strict=False)),
        default=0.0,
    )


def _read(file: Path) -> dict[str, Any]:
    if not file.is_file():
        return {}
    try:
        data = json.loads(gzip.decompress(file.read_bytes()))
        if data["schema"] == SCHEMA:
            return {
                name: {"of": run["of"], "replay": run["replay"]}
                for name, run in data["scenarios"].items()
            }
    except (
        OSError,
        EOFError,
        zlib.error,
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
    ) as error:
        again = "record it again with `rosgrade selftest --record`"
        raise AssignmentError(file, [Problem(f"it cannot be read ({error}): {again}")]) from error
    return {}
