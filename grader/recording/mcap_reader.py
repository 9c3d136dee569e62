"""A recording from its MCAP file, checked at the edge."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, get_args, get_type_hints

from mcap.reader import make_reader
from mcap.records import Attachment, Channel, DataEnd, Metadata, Schema
from mcap.records import Message as Record
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from pydantic import TypeAdapter

from grader.errors import UsageError
from grader.recording.mcap_writer import CHANNELS, FORMAT, JOIN, SENT, TOPIC
from grader.recording.model import Message, Recording
from grader.submission.record import SubmissionRecord

_FIELDS = get_type_hints(Recording)
_FACTS: dict[str, type] = {name: get_args(_FIELDS[name])[0] for name in CHANNELS}
_PLAIN = frozenset({bool, int, float, str, bytes})
"""Types of the primitive fields, and of an array of bytes."""


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def get_ready() -> None:
    """Make what validates the facts; otherwise the first recording waits for it."""
    for kind in (*_FACTS.values(), Recording):
        _adapter(kind)


def read_recording(file: Path) -> Recording:
    """Read a recording.

    Raises:
        UsageError: The file is missing, damaged, or not a recording of rosgrade.
    """
    try:
        with file.open("rb") as stream:
            return _read(stream)
    except OSError as error:
        raise UsageError(f"{file}: {error.strerror or error}") from error
    except _NotARecording as error:
        raise UsageError(f"{file}: {error}") from error
    except Exception as error:
        # The readers of MCAP, its compressions and CDR raise whatever damage makes them raise.
        reason = str(error).partition("\n")[0] or type(error).__name__
        raise UsageError(f"{file}: damaged recording: {reason}") from error


class _NotARecording(Exception):
    pass


def _read(stream: Any) -> Recording:
    frame: dict[str, Any] | None = None
    submission: SubmissionRecord | None = None
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    facts: dict[str, list[Any]] = {name: [] for name in CHANNELS}
    messages: dict[str, list[Message]] = {}
    sent: dict[str, list[Message]] = {}
    joined: dict[str, list[Message]] = {}
    unreadable: dict[str, int] = {}
    has_ended = False
    # All of it, once, with its checksums: a flipped bit must not become another grade.
    for record in StreamReader(stream, validate_crcs=True).records:
        if isinstance(record, DataEnd):
            has_ended = True
        elif isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel):
            channels[record.id] = record
        elif isinstance(record, Metadata) and record.name == "rosgrade":
            frame = _frame(record)
        elif isinstance(record, Attachment) and record.name == "submission.json":
            submission = _adapter(SubmissionRecord).validate_json(record.data)
        elif isinstance(record, Record):
            channel = channels[record.channel_id]
            if channel.message_encoding == "json":
                name = channel.topic.removeprefix("/rosgrade/")
                if name in facts:
                    fact = _adapter(_FACTS[name]).validate_json(record.data)
                    facts[name].append((record.sequence, fact))
                continue
            if has_ended:
                # What follows has no checksum: a flipped bit makes a message of a summary.
                raise ValueError("a message after the end of the data")
            decode = _decoder_of(schemas[channel.schema_id])
            try:
                value = _fields(decode(record.data))
            except NotImplementedError as error:
                # A type that the library cannot read is no fault of who published it.
                raise ValueError(f"{channel.topic}: {error}") from error
            except Exception:
                # The checksums agree: so it was published, as rclpy publishes any bytes. What
                # decodes CDR raises whatever comes of such bytes.
                name = channel.metadata.get(TOPIC, channel.topic)
                unreadable[name] = unreadable.get(name, 0) + 1
                continue
            found = _message(record, channel, schemas[channel.schema_id], value)
            join = channel.metadata.get(JOIN)
            if join is not None:
                joined.setdefault(join, []).append(found)
            else:
                topics = sent if SENT in channel.metadata else messages
                topics.setdefault(found.topic, []).append(found)
    if frame is None:
        raise _NotARecording("an MCAP file, but not a recording of rosgrade")
    if submission is None:
        raise _NotARecording("the facts of the submission are missing")
    ordered = {
        name: tuple(fact for _, fact in sorted(items, key=lambda item: item[0]))
        for name, items in facts.items()
    }
    unmatched: dict[str, list[Message]] = {topic: [] for topic in frame.pop("sent", ())}
    recording: Recording = _adapter(Recording).validate_python(
        {
            **frame,
            **ordered,
            "submission": submission,
            "messages": _in_order(messages),
            "sent": _in_order(unmatched | sent),
            "joined": {name: tuple(items) for name, items in joined.items()},
            "unreadable": unreadable,
        }
    )
    return recording


def _decoder_of(schema: Schema) -> Callable[[bytes], Any]:
    return _decoder(schema.name, schema.encoding, schema.data)


def _message(record: Record, channel: Channel, schema: Schema, value: Any) -> Message:
    return Message(
        topic=channel.metadata.get(TOPIC, channel.topic),
        type=schema.name,
        value=value,
        stamp_ns=record.publish_time,
        received_ns=record.log_time,
        sequence=record.sequence,
    )


@lru_cache(maxsize=64)
def _decoder(name: str, encoding: str, definition: bytes) -> Callable[[bytes], Any]:
    """What decodes the messages of a type; each recording of a class has the same ones."""
    schema = Schema(id=0, name=name, encoding=encoding, data=definition)
    decode = DecoderFactory().decoder_for("cdr", schema)
    if decode is None:
        raise ValueError(f"{name} is defined as {encoding}, not as ros2msg")
    return decode


def _in_order(messages: Mapping[str, list[Message]]) -> dict[str, tuple[Message, ...]]:
    return {
        topic: tuple(sorted(items, key=lambda m: (m.stamp_ns, m.sequence)))
        for topic, items in messages.items()
    }


def read_topic(file: Path, topic: str) -> tuple[tuple[Message, ...], tuple[str, ...]]:
    """Read the messages on one topic of any MCAP file with messages of ROS 2.

    Raises:
        OSError: The file cannot be read.
        ValueError: It is damaged, or no MCAP file.
    """
    factory = DecoderFactory()
    found = []
    with file.open("rb") as stream:
        try:
            reader = make_reader(stream)
            summary = reader.get_summary()
            channels = summary.channels.values() if summary else ()
            topics = tuple(sorted({channel.topic for channel in channels}))
            for schema, channel, message in reader.iter_messages(topics=[topic]):
                decode = factory.decoder_for(channel.message_encoding, schema)
                if decode is None or schema is None:
                    continue
                found.append(
                    Message(
                        topic,
                        schema.name,
                        _fields(decode(message.data)),
                        message.publish_time,
                        message.log_time,
                        message.sequence,
                    )
                )
        except Exception as error:
            # As in read_recording: damage has many faces.
            reason = str(error).partition("\n")[0] or type(error).__name__
            raise ValueError(f"no MCAP file that can be read: {reason}") from error
    return tuple(found), topics


def _frame(record: Metadata) -> dict[str, Any]:
    frame = {key: json.loads(value) for key, value in record.metadata.items()}
    if frame.pop("format", None) != FORMAT:
        raise _NotARecording(f"made by another version of rosgrade (not format {FORMAT})")
    return frame


def _fields(value: Any) -> Any:
    """Plain mappings and lists from what the CDR decoder made."""
    kind = type(value)
    if kind in _PLAIN:
        return value
    if kind is list:
        # All of an array is of one type, and the ranges of a scan are many.
        return list(map(_fields, value)) if value and type(value[0]) not in _PLAIN else value
    return {name: _fields(getattr(value, name)) for name in kind.__slots__}
