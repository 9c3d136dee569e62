"""The reference's own runs, recorded once and shipped beside the assignment.

``assignments/<id>/reference.json.gz`` holds a replay of each scenario with a robot, so that a
student sees the own run and a right one side by side.
"""

from __future__ import annotations

import gzip
import hashlib
import json
import zlib
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from grader.assignment.load import LoadedAssignment
from grader.assignment.model import Scenario
from grader.errors import AssignmentError, Problem, UsageError
from grader.findings.words import counted
from grader.grade import Grade
from grader.recording.model import Recording
from grader.report.files import write_whole
from grader.report.html.replay import Replay, make_replay

REFERENCE_FILE = "reference.json.gz"
SCHEMA = 1


def read_references(loaded: LoadedAssignment) -> dict[str, Replay]:
    """Replays of the reference by scenario id.

    A scenario that has changed since is left out: its run would mislead.
    """
    runs = _read(loaded.folder / REFERENCE_FILE)
    return {
        scenario.id: runs[scenario.id]["replay"]
        for scenario in loaded.assignment.scenarios
        if scenario.id in runs and runs[scenario.id]["of"] == scenario_hash(loaded, scenario)
    }


def keep_reference(
    loaded: LoadedAssignment, grade: Grade, recordings: Mapping[str, Recording]
) -> str:
    """Keep the runs of the reference, and say where."""
    name, file = loaded.assignment.id, loaded.folder / REFERENCE_FILE
    if not grade.full_points:
        raise UsageError(f"{name}: the reference does not get full points, so no run is kept")
    runs = {}
    for scenario in loaded.assignment.scenarios:
        if scenario.id in recordings:
            replay = make_replay(recordings[scenario.id], scenario)
            if replay is not None:
                runs[scenario.id] = {"of": scenario_hash(loaded, scenario), "replay": replay}
    if not runs:
        return f"{name}: no scenario with a robot, nothing to keep"
    write_whole(file, _packed(runs))
    return f"{name}: {counted(len(runs), 'run')} of the reference kept in {file}"


def only_scenarios(file: Path, scenarios: Collection[str]) -> bytes:
    """The content of such a file with the runs of these scenarios alone."""
    return _packed({name: run for name, run in _read(file).items() if name in scenarios})


def _packed(runs: Mapping[str, Any]) -> bytes:
    text = json.dumps({"schema": SCHEMA, "scenarios": runs}, separators=(",", ":"), sort_keys=True)
    # Without the time of writing, so that the same runs are the same bytes.
    return gzip.compress(text.encode(), mtime=0)


def scenario_hash(loaded: LoadedAssignment, scenario: Scenario) -> str:
    """Hash of everything that a run depends on: the scenario as it is read, and its world."""
    definition = scenario.model_dump_json(exclude_defaults=True, exclude={"title"})
    digest = hashlib.sha256(definition.encode())
    if scenario.world is not None:
        digest.update((loaded.folder / scenario.world).read_bytes())
    if scenario.simulator is not None and scenario.simulator.map is not None:
        digest.update((loaded.folder / scenario.simulator.map).read_bytes())
    return digest.hexdigest()[:16]


def _read(file: Path) -> dict[str, Any]:
    if not file.is_file():
        return {}
    try:
        data = json.loads(gzip.decompress(file.read_bytes()))
        return dict(data["scenarios"]) if data["schema"] == SCHEMA else {}
    except (OSError, EOFError, zlib.error, ValueError, KeyError, TypeError) as error:
        again = "record it again with `rosgrade selftest --record`"
        raise AssignmentError(file, [Problem(f"it cannot be read ({error}): {again}")]) from error
