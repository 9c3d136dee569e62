"""A recording into an MCAP file that any reader of ROS bags opens.

Its channels hold messages of ROS only, with their CDR bytes and a ``ros2msg`` schema; one on
``/rosgrade/launched`` marks time zero. Everything else is an attachment: ``<kind>.json.gz`` for
each kind of fact, ``submission.json`` for the submission's; the frame of the run is the metadata
``rosgrade``.
"""

from __future__ import annotations

import dataclasses
import gzip
import json
import os
import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, is_dataclass
from pathlib import Path
from typing import get_args, get_origin, get_type_hints

from mcap.writer import CompressionType, Writer

from grader.recording.model import NS, Recording, to_json

# Metadata of a channel of messages.
JOIN, TOPIC, SENT = "rosgrade_join", "rosgrade_topic", "rosgrade_sent"

FORMAT = "3"
"""Version of the layout; 2 had the facts as channels of JSON under ``/rosgrade/``."""
FACTS_SUFFIX = ".json.gz"
LAUNCHED = "/rosgrade/launched"
_TIME = "builtin_interfaces/msg/Time", "ros2msg", b"int32 sec\nuint32 nanosec\n"

FACTS: dict[str, type] = {
    name: get_args(kind)[0]
    for name, kind in get_type_hints(Recording).items()
    if get_origin(kind) is tuple and is_dataclass(get_args(kind)[0])
}
"""Fields of the recording that are kept as JSON -> class of a fact."""

_FRAME = (
    *("scenario", "seed", "launched_ns", "matched_ns", "stop_ns", "end_ns", "faults"),
    *("values", "answers", "environment"),
)
"""Fields of the recording that are kept as they are in the metadata."""


@dataclass(frozen=True)
class RawMessage:
    """A message as it came over DDS.

    Attributes:
        cdr: Serialized bytes with their encapsulation header.
        join: Name of the late joiner that received it, or empty.
    """

    topic: str
    type: str
    cdr: bytes
    stamp_ns: int
    received_ns: int
    sequence: int
    join: str = ""
    is_sent: bool = False


def write_recording(
    file: Path,
    recording: Recording,
    messages: Iterable[RawMessage],
    definitions: Mapping[str, str],
    submission: bytes | None = None,
) -> None:
    """Write a recording; the file appears whole or not at all.

    Args:
        recording: What was observed; its own ``messages`` are ignored.
        messages: The messages as bytes.
        submission: The submission's facts as JSON, where the recording itself does not have
            them (a cell passes them on unread).
    """
    facts = submission or to_json(recording.submission)
    temporary = file.with_name(f".{file.name}.{os.getpid()}")
    try:
        with temporary.open("wb") as stream:
            writer = Writer(stream, compression=CompressionType.ZSTD, enable_data_crcs=True)
            writer.start(profile="ros2", library="rosgrade")
            writer.add_metadata("rosgrade", _frame(recording))
            _write_launched(writer, recording.launched_ns)
            _write_messages(writer, messages, definitions)
            _write_facts(writer, recording)
            at_ns = recording.launched_ns
            writer.add_attachment(at_ns, at_ns, "submission.json", "application/json", facts)
            writer.finish()  # type: ignore[no-untyped-call]
        temporary.replace(file)
    finally:
        temporary.unlink(missing_ok=True)


def _write_facts(writer: Writer, recording: Recording) -> None:
    at_ns = recording.launched_ns
    for name in FACTS:
        if facts := getattr(recording, name):
            # Without a time in it, so that the same recording is the same bytes.
            data = gzip.compress(to_json(facts), mtime=0)
            writer.add_attachment(at_ns, at_ns, f"{name}{FACTS_SUFFIX}", "application/gzip", data)


def _write_launched(writer: Writer, at_ns: int) -> None:
    """The launch as a message, so that a bag begins with it in any tool."""
    channel = writer.register_channel(LAUNCHED, "cdr", writer.register_schema(*_TIME))
    cdr = b"\x00\x01\x00\x00" + struct.pack("<iI", *divmod(at_ns, NS))
    writer.add_message(channel, at_ns, cdr, at_ns)


def _write_messages(
    writer: Writer, messages: Iterable[RawMessage], definitions: Mapping[str, str]
) -> None:
    channels: dict[tuple[str, str, str, bool], int] = {}
    schemas: dict[str, int] = {}
    for one in messages:
        key = (one.topic, one.type, one.join, one.is_sent)
        if one.type not in schemas:
            definition = definitions[one.type].encode()
            schemas[one.type] = writer.register_schema(one.type, "ros2msg", definition)
        if key not in channels:
            topic = f"/rosgrade/joins/{one.join}" if one.join else one.topic
            metadata = {SENT: "true"} if one.is_sent else {}
            metadata = {JOIN: one.join, TOPIC: one.topic} if one.join else metadata
            schema = schemas[one.type]
            channels[key] = writer.register_channel(topic, "cdr", schema, metadata)
        writer.add_message(channels[key], one.received_ns, one.cdr, one.stamp_ns, one.sequence)


def _frame(recording: Recording) -> dict[str, str]:
    frame = {name: getattr(recording, name) for name in _FRAME}
    frame |= {"format": FORMAT, "ending": recording.ending.value, "sent": sorted(recording.sent)}
    frame["scenes"] = {name: dataclasses.asdict(scene) for name, scene in recording.scenes.items()}
    frame["names"] = dataclasses.asdict(recording.names)
    return {key: json.dumps(value, sort_keys=True, default=dict) for key, value in frame.items()}
