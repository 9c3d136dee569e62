"""Bags of a submission, as ``ros2 bag record`` writes them, read to their end.

Each bag is read by a process of its own with bounded time and memory: its file is the student's.
"""

from __future__ import annotations

import json
import os
import resource
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from pydantic import TypeAdapter

from grader.errors import GraderFault
from grader.submission.build.bounded import OutputLimits, run_bounded
from grader.submission.intake.listing import SubmissionFile
from grader.submission.intake.paths import join, shown
from grader.submission.record import BagRecord

_METADATA = "metadata.yaml"
_STORAGE = (".mcap", ".db3")
_MOST_BAGS = 10
_WALL_S = 30.0
_MEMORY_BYTES = 2 * 2**30
_OUTPUT = OutputLimits(head=256 * 1024, tail=4096)
_RECORD = TypeAdapter(BagRecord)


def read_bags(root: Path, files: Sequence[SubmissionFile]) -> tuple[BagRecord, ...]:
    """Read every bag of a submission."""
    paths = {file.path for file in files}
    folders = {path.rpartition("/")[0] or "." for path in paths if path.endswith(_STORAGE)}
    return tuple(
        _read(root, folder, has_metadata=join(folder, _METADATA) in paths)
        for folder in sorted(folders, key=os.fsencode)[:_MOST_BAGS]
    )


def _read(root: Path, folder: str, *, has_metadata: bool) -> BagRecord:
    path = shown(folder)
    if not has_metadata:
        return BagRecord(path, f"it has no {_METADATA}, which is written when the recording ends")
    try:
        outcome = run_bounded(
            [sys.executable, "-I", "-m", __name__, str(root / folder)],
            cwd=root,
            environment={"PATH": os.defpath, "_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1"},
            wall_s=_WALL_S,
            output=_OUTPUT,
        )
        return _RECORD.validate_python({"path": path, **json.loads(outcome.output)})
    except (GraderFault, ValueError, TypeError):
        return BagRecord(path, "it cannot be read")


def _contents(bag: Path) -> dict[str, object]:
    """What is in a bag, by reading each of its messages."""
    from rosbags.rosbag2 import Reader

    messages: Counter[tuple[str, str]] = Counter()
    with Reader(bag) as reader:
        messages.update({(one.topic, one.msgtype): 0 for one in reader.connections})
        for connection, _, _ in reader.messages():
            messages[connection.topic, connection.msgtype] += 1
        duration_s = reader.duration / 1e9 if messages.total() else 0.0
    topics = [
        {"name": shown(name), "type": shown(kind), "messages": count}
        for (name, kind), count in sorted(messages.items())
    ]
    return {"duration_s": duration_s, "topics": topics}


def main() -> int:
    """Print what is in the bag that the command line names, as JSON."""
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
    try:
        found = _contents(Path(sys.argv[1]))
    # A damaged file makes any of the libraries below raise anything.
    except Exception as error:
        found = {"problem": f"it cannot be read: {shown(str(error))[:300] or type(error).__name__}"}
    print(json.dumps(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
