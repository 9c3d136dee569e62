"""A recording from its MCAP file, checked at the edge."""

from __future__ import annotations

import gzip
import json
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping
from functools import cache, lru_cache
from operator import itemgetter
from pathlib import Path
from types import GenericAlias
from typing import Any

from mcap.reader import make_reader
from mcap.records import Attachment, Channel, DataEnd, Metadata, Schema
from mcap.records import Message as Record
from mcap.stream_reader import StreamReader
from pydantic import TypeAdapter

from grader.errors import UsageError
from grader.recording.cdr import decoder
from grader.recording.mcap_writer import (
    FACTS,
    FACTS_SUFFIX,
    FORMAT,
    JOIN,
    LAUNCHED,
    SENT,
    TOPIC,
    RawMessage,
)
from grader.recording.model import Message, Recording
from grader.recording.old_names import names_of_run
from grader.recording.submission import SubmissionRecord, record_of

_LISTS = {name: GenericAlias(list, (kind,)) for name, kind in FACTS.items()}


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def get_ready() -> None:
    """Make what validates the facts; otherwise the first recording waits for it."""
    for kind in (*_LISTS.values(), Recording):
        _adapter(kind)


def read_recording(file: Path) -> Recording:
    """Read a recording; a UsageError says that it is missing, damaged, or another file."""
    try:
        with file.open("rb") as stream:
            return _read(stream)
    except OSError as error:
        raise UsageError(f"{file}: {error.strerror or error}") from error
    except _NotARecording as error:
        raise UsageError(f"{file}: {error}") from error
    except Exception as error:
        raise UsageError(f"{file}: damaged recording: {_reason(error)}") from error


def _reason(error: Exception) -> str:
    # On a damaged file the readers of MCAP, its compressions and CDR raise errors of any kind.
    return str(error).partition("\n")[0] or type(error).__name__


class _NotARecording(Exception):
    pass


def _read(stream: Any) -> Recording:
    contents = _Contents()
    # All of it, once, with its checksums: a flipped bit must not become another grade.
    for record in StreamReader(stream, validate_crcs=True).records:
        contents.take(record)
    return contents.recording()


class _Contents:
    """What the records of a file hold, taken one after the other."""

    def __init__(self) -> None:
        self._frame: dict[str, Any] | None = None
        self._submission: SubmissionRecord | None = None
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._facts: dict[str, list[tuple[int, Any]]] = {name: [] for name in FACTS}
        self._messages: defaultdict[str, list[Message]] = defaultdict(list)
        self._sent: defaultdict[str, list[Message]] = defaultdict(list)
        self._joined: defaultdict[str, list[Message]] = defaultdict(list)
        self._unreadable: Counter[str] = Counter()
        self._has_ended = False

    def take(self, record: Any) -> None:
        """Keep what a record holds."""
        if isinstance(record, DataEnd):
            self._has_ended = True
        elif isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, Channel):
            self._channels[record.id] = record
        elif isinstance(record, Metadata) and record.name == "rosgrade":
            self._frame = _frame(record)
        elif isinstance(record, Attachment):
            self._take_attachment(record)
        elif isinstance(record, Record):
            self._take_message(record, self._channels[record.channel_id])

    def _take_attachment(self, record: Attachment) -> None:
        name = record.name.removesuffix(FACTS_SUFFIX)
        if record.name == "submission.json":
            self._submission = record_of(record.data)
        elif name in FACTS:
            data = gzip.decompress(record.data)
            self._facts[name] += enumerate(_adapter(_LISTS[name]).validate_json(data))

    def _take_message(self, record: Record, channel: Channel) -> None:
        if channel.message_encoding == "json":
            # Format 2 has the facts so.
            name = channel.topic.removeprefix("/rosgrade/")
            if name in self._facts:
                fact = _adapter(FACTS[name]).validate_json(record.data)
                self._facts[name].append((record.sequence, fact))
            return
        if channel.topic == LAUNCHED:
            return
        if self._has_ended:
            # What follows has no checksum: a flipped bit makes a message of a summary.
            raise ValueError("a message after the end of the data")
        try:
            message = _message(self._schemas[channel.schema_id], channel, record)
        except _Unreadable:
            self._unreadable[channel.metadata.get(TOPIC, channel.topic)] += 1
            return
        if JOIN in channel.metadata:
            self._joined[channel.metadata[JOIN]].append(message)
        elif SENT in channel.metadata:
            self._sent[message.topic].append(message)
        else:
            self._messages[message.topic].append(message)

    def recording(self) -> Recording:
        """The recording that the records make."""
        if self._frame is None:
            raise _NotARecording("an MCAP file, but not a recording of rosgrade")
        if self._submission is None:
            raise _NotARecording("the facts of the submission are missing")
        frame = dict(self._frame)
        unmatched: dict[str, list[Message]] = {topic: [] for topic in frame.pop("sent", ())}
        facts = {
            name: [fact for _, fact in sorted(numbered, key=itemgetter(0))]
            for name, numbered in self._facts.items()
        }
        recording: Recording = _adapter(Recording).validate_python(
            {
                **frame,
                **facts,
                "submission": self._submission,
                "messages": _in_order(self._messages),
                "sent": _in_order(unmatched | self._sent),
                "joined": dict(self._joined),
                "unreadable": dict(self._unreadable),
            }
        )
        return recording


class _Unreadable(Exception):
    """A message of other bytes than its type has: rclpy publishes any bytes."""


def _message(schema: Schema, channel: Channel, record: Record) -> Message:
    try:
        decode = _decoder(schema.name, schema.encoding, schema.data)
    except ValueError as error:
        # A type that cannot be read is not the fault of the publisher.
        raise ValueError(f"{channel.topic}: {error}") from error
    try:
        value = decode(record.data)
    except Exception as error:
        raise _Unreadable from error
    return Message(
        topic=channel.metadata.get(TOPIC, channel.topic),
        type=schema.name,
        value=value,
        stamp_ns=record.publish_time,
        received_ns=record.log_time,
        sequence=record.sequence,
    )


@lru_cache(maxsize=64)
def _decoder(name: str, encoding: str, definition: bytes) -> Callable[[bytes], dict[str, Any]]:
    """The decoder of a type's messages; each recording of a class has the same types."""
    if encoding != "ros2msg":
        raise ValueError(f"{name} is defined as {encoding}, not as ros2msg")
    return decoder(name, definition.decode())


def _in_order(messages: Mapping[str, list[Message]]) -> dict[str, tuple[Message, ...]]:
    return {
        topic: tuple(sorted(items, key=lambda m: (m.stamp_ns, m.sequence)))
        for topic, items in messages.items()
    }


def read_topic(file: Path, topic: str) -> tuple[tuple[Message, ...], tuple[str, ...]]:
    """The messages on one topic of any MCAP file of ROS 2, and its topics."""
    messages = []
    topics = set()
    with file.open("rb") as stream:
        try:
            for schema, channel, record in make_reader(stream).iter_messages():
                topics.add(channel.topic)
                if channel.topic == topic and schema is not None:
                    messages.append(_message(schema, channel, record))
        except Exception as error:
            raise ValueError(f"no MCAP file that can be read: {_reason(error)}") from error
    return tuple(messages), tuple(sorted(topics))


def read_inputs(file: Path, recording: Recording) -> tuple[RawMessage, ...]:
    """The messages that the probe or the simulator published, in that order."""
    simulated = {topic for scene in recording.scenes.values() for topic in scene.published}
    inputs: list[RawMessage] = []
    try:
        with file.open("rb") as stream:
            for schema, channel, message in make_reader(stream).iter_messages():
                is_sent = SENT in channel.metadata
                is_ours = is_sent or channel.topic in simulated
                if is_ours and schema is not None and channel.message_encoding == "cdr":
                    times = message.publish_time, message.log_time, message.sequence
                    raw = (channel.topic, schema.name, message.data, *times)
                    inputs.append(RawMessage(*raw, is_sent=is_sent))
    except OSError as error:
        raise UsageError(f"{file}: {error.strerror or error}") from error
    return tuple(sorted(inputs, key=lambda message: message.stamp_ns))


def _frame(record: Metadata) -> dict[str, Any]:
    frame = {key: json.loads(value) for key, value in record.metadata.items()}
    if frame.pop("format", None) not in ("2", FORMAT):
        raise _NotARecording(f"made by another version of rosgrade (not format {FORMAT})")
    # From when there was one robot in a simulation.
    scene = frame.pop("scene", None)
    if scene:
        frame["scenes"] = {"": scene}
    if "names" not in frame:
        frame["names"] = names_of_run(frame["environment"])
    return frame
