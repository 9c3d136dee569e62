"""A bag out of a recording, as if its messages had been recorded with ``ros2 bag record``.

python -m grader.dev.bag RECORDING BAG [mcap|sqlite3] [TOPIC ...]
"""

from __future__ import annotations

import sys
from collections.abc import Collection
from pathlib import Path

from mcap.reader import make_reader

from grader.recording.bag import BagChannel, BagMessage
from grader.recording.bag_writer import write_bag
from grader.recording.mcap_reader import read_recording
from grader.recording.mcap_writer import LAUNCHED
from grader.recording.model import Kind


def bag_of(
    recording: Path, folder: Path, storage: str = "mcap", topics: Collection[str] = ()
) -> None:
    """Write the messages of a recording as a bag; by default those on all topics."""
    ends = [one for one in read_recording(recording).endpoints if one.kind is Kind.PUBLISHER]
    messages, definitions = [], {}
    with recording.open("rb") as stream:
        for schema, channel, one in make_reader(stream).iter_messages():
            if schema is None or channel.metadata or channel.topic == LAUNCHED:
                continue
            if topics and channel.topic not in topics:
                continue
            own = [end for end in ends if (end.topic, end.type) == (channel.topic, schema.name)]
            type_hash = next((end.type_hash for end in own), "")
            made = BagChannel(channel.topic, schema.name, type_hash, tuple(end.qos for end in own))
            messages.append(BagMessage(made, one.log_time, one.publish_time, one.data))
            definitions[schema.name] = schema.data.decode()
    write_bag(folder, messages, definitions, storage)


if __name__ == "__main__":
    given = [*sys.argv[1:], "mcap"][:3]
    bag_of(Path(given[0]), Path(given[1]), given[2], sys.argv[4:])
