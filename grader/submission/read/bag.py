"""Bags of a submission, as ``ros2 bag record`` writes them, read to their end.

Each bag is read by a process of its own, in the sandbox and the limits of a build: its file is the
student's, and a small one may unpack to a disk full.
"""

from __future__ import annotations

import hashlib
import json
import os
import signal
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import TypeAdapter

from grader.errors import GraderFault
from grader.machine.out_of_memory import oom_kills
from grader.machine.ros import RosInstallation
from grader.recording.bag import BagChannel, KeptBag
from grader.recording.model import Qos
from grader.recording.submission import BagRecord, BagTopic
from grader.submission.build.bounded import Outcome, OutputLimits
from grader.submission.intake.listing import SubmissionFile
from grader.submission.intake.locate import Located
from grader.submission.intake.paths import join, shown
from grader.submission.read.reader import Reader

if TYPE_CHECKING:
    from grader.sandbox.sandbox import Sandbox

_METADATA = "metadata.yaml"
_STORAGE = (".mcap", ".db3", ".mcap.zstd", ".db3.zstd")
_JOURNALS = (".db3-wal", ".db3-journal")
_MOST_BAGS = 10
_CPU_S = 30
_WALL_S = 300.0
_READER = Reader(
    "bag_contents.py", ("rosbags", "mcap"), _WALL_S, OutputLimits(head=1024 * 1024, tail=4096)
)


@dataclass(frozen=True)
class _Topic:
    name: str
    type: str
    messages: int
    hash: str
    publishers: tuple[Qos, ...]


@dataclass(frozen=True)
class _Contents:
    """What the process prints of a bag."""

    problem: str | None = None
    duration_s: float = 0.0
    distro: str = ""
    lost: int = 0
    has_published: bool = False
    topics: tuple[_Topic, ...] = ()


_CONTENTS = TypeAdapter(_Contents)


@dataclass(frozen=True)
class ReadBag:
    """A bag with what is kept of its messages, if it can be read."""

    record: BagRecord
    kept: KeptBag | None = None


def read_bags(
    located: Located,
    ros: RosInstallation,
    sandbox: Sandbox | None,
    types: Collection[str] | None = (),
) -> tuple[ReadBag, ...]:
    """Read every bag of a submission, at most ten.

    Args:
        located: The submission's private copy; what is unpacked of a bag lies beside it for a
            while.
        types: Of the messages that are kept; None for all.

    Raises:
        GraderFault: One was not read within minutes, by no fault of its own.
    """
    paths = {file.path for file in located.files}
    folders = {path.rpartition("/")[0] or "." for path in paths if path.endswith(_STORAGE)}
    kept_types = json.dumps(None if types is None else sorted(types))
    bags = []
    for folder in sorted(folders, key=os.fsencode)[:_MOST_BAGS]:
        problem = _why_unended(folder, located.files)
        if problem is None:
            bags.append(_read(located.root, folder, kept_types, ros, sandbox))
        else:
            bags.append(ReadBag(BagRecord(shown(folder), problem)))
    return tuple(bags)


def _why_unended(folder: str, files: Sequence[SubmissionFile]) -> str | None:
    """Why the recording of a bag did not end as it should, by the files in its folder."""
    beside = [one for one in files if (one.path.rpartition("/")[0] or ".") == folder]
    if not any(one.path == join(folder, _METADATA) for one in beside):
        return f"it has no {_METADATA}, which is written when the recording ends"
    for one in beside:
        if one.path.endswith(_JOURNALS) and one.size:
            return f"{shown(one.path)} lies in it, so not all messages are in the bag itself yet"
    return None


def _read(
    root: Path, folder: str, kept_types: str, ros: RosInstallation, sandbox: Sandbox | None
) -> ReadBag:
    path, kills = shown(folder), oom_kills()
    arguments = (str(root / folder), str(_CPU_S))
    outcome, data = _READER.run(root, arguments, ros, sandbox, kept_types)
    problem = _why_not_read(outcome, path, kills)
    if problem is not None:
        return ReadBag(BagRecord(path, problem))
    try:
        contents = _CONTENTS.validate_python(json.loads(outcome.output))
    except (ValueError, TypeError):
        return ReadBag(BagRecord(path, "it cannot be read"))
    topics = contents.topics
    record = BagRecord(
        path,
        shown(contents.problem) if contents.problem else contents.problem,
        contents.duration_s,
        tuple(BagTopic(shown(one.name), shown(one.type), one.messages) for one in topics),
        shown(contents.distro),
        contents.lost,
        hashlib.sha256(data).hexdigest() if data else "",
    )
    if record.problem:
        return ReadBag(record)
    channels = tuple(
        BagChannel(shown(one.name), shown(one.type), one.hash, one.publishers) for one in topics
    )
    return ReadBag(record, KeptBag(channels, contents.has_published, data))


def _why_not_read(outcome: Outcome, path: str, kills: int | None) -> str | None:
    """Why reading was cut off, or None."""
    if outcome.ended_by_us == "time":
        raise GraderFault(f"the bag {path} was not read within {_WALL_S:.0f} s")
    if outcome.ended_by_us:
        return f"it cannot be read: {outcome.ended_by_us}"
    # bubblewrap ends as a shell does: 128 and the signal.
    if abs(outcome.status or 0) % 128 in (signal.SIGXCPU, signal.SIGKILL):
        if kills != oom_kills():
            raise GraderFault(f"this machine ran out of memory while the bag {path} was read")
        return f"it cannot be read within {_CPU_S} s of CPU time"
    return None
