"""Bags of a submission, as ``ros2 bag record`` writes them, read to their end.

Each bag is read by a process of its own, in the sandbox and the limits of a build: its file is the
student's, and a small one may unpack to a disk full.
"""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import TypeAdapter

from grader.errors import GraderFault
from grader.machine.out_of_memory import oom_kills
from grader.machine.ros import RosInstallation
from grader.recording.submission import BagRecord, BagTopic
from grader.submission.build.bounded import OutputLimits
from grader.submission.intake.locate import Located
from grader.submission.intake.paths import join, shown
from grader.submission.read.reader import Reader

if TYPE_CHECKING:
    from grader.sandbox.sandbox import Sandbox

_METADATA = "metadata.yaml"
_STORAGE = (".mcap", ".db3", ".mcap.zstd", ".db3.zstd")
_MOST_BAGS = 10
_CPU_S = 30
_WALL_S = 300.0
_READER = Reader("bag_contents.py", ("rosbags",), _WALL_S, OutputLimits(head=256 * 1024, tail=4096))
_RECORD = TypeAdapter(BagRecord)


def read_bags(
    located: Located, ros: RosInstallation, sandbox: Sandbox | None
) -> tuple[BagRecord, ...]:
    """Read every bag of a submission, at most ten.

    Args:
        located: The submission's private copy; what is unpacked of a bag lies beside it for a
            while.

    Raises:
        GraderFault: One was not read within minutes, by no fault of its own.
    """
    paths = {file.path for file in located.files}
    folders = {path.rpartition("/")[0] or "." for path in paths if path.endswith(_STORAGE)}
    return tuple(
        _read(located.root, folder, ros, sandbox)
        if join(folder, _METADATA) in paths
        else BagRecord(
            shown(folder), f"it has no {_METADATA}, which is written when the recording ends"
        )
        for folder in sorted(folders, key=os.fsencode)[:_MOST_BAGS]
    )


def _read(root: Path, folder: str, ros: RosInstallation, sandbox: Sandbox | None) -> BagRecord:
    path, kills = shown(folder), oom_kills()
    outcome = _READER.run(root, (str(root / folder), str(_CPU_S)), ros, sandbox)
    if outcome.ended_by_us == "time":
        raise GraderFault(f"the bag {path} was not read within {_WALL_S:.0f} s")
    if outcome.ended_by_us:
        return BagRecord(path, f"it cannot be read: {outcome.ended_by_us}")
    # bubblewrap ends as a shell does: 128 and the signal.
    if abs(outcome.status or 0) % 128 in (signal.SIGXCPU, signal.SIGKILL):
        if kills != oom_kills():
            raise GraderFault(f"this machine ran out of memory while the bag {path} was read")
        return BagRecord(path, f"it cannot be read within {_CPU_S} s of CPU time")
    try:
        found = _RECORD.validate_python({"path": path, **json.loads(outcome.output)})
    except (ValueError, TypeError):
        return BagRecord(path, "it cannot be read")
    topics = (BagTopic(shown(one.name), shown(one.type), one.messages) for one in found.topics)
    problem = found.problem and shown(found.problem)
    return BagRecord(path, problem, found.duration_s, tuple(topics))
