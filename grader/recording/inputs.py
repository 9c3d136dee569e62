"""What a node was given in a recording, as bytes: to give it the very same again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from mcap.reader import make_reader

from grader.errors import UsageError
from grader.recording.mcap_writer import SENT, RawMessage
from grader.recording.model import Recording


def read_inputs(file: Path, recording: Recording) -> tuple[RawMessage, ...]:
    """The messages that the probe or the simulator published, in that order."""
    simulated = simulated_topics(recording)
    found: list[RawMessage] = []
    try:
        with file.open("rb") as stream:
            for schema, channel, message in make_reader(stream).iter_messages():
                is_sent = SENT in channel.metadata
                is_ours = is_sent or channel.topic in simulated
                if is_ours and schema is not None and channel.message_encoding == "cdr":
                    times = message.publish_time, message.log_time, message.sequence
                    raw = RawMessage(channel.topic, schema.name, message.data, *times)
                    found.append(replace(raw, is_sent=is_sent))
    except OSError as error:
        raise UsageError(f"{file}: {error.strerror or error}") from error
    return tuple(sorted(found, key=lambda message: message.stamp_ns))


def simulated_topics(recording: Recording) -> frozenset[str]:
    """Topics on which the simulator published."""
    scene = recording.scene
    return frozenset({scene.odometry_topic, scene.scan_topic} if scene else ())
