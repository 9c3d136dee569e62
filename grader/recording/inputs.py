"""What a node was given in a recording, as bytes: to give it the very same again."""

from __future__ import annotations

from pathlib import Path

from mcap.reader import make_reader

from grader.errors import UsageError
from grader.recording.mcap_writer import SENT, RawMessage
from grader.recording.model import Recording


def read_inputs(file: Path, recording: Recording) -> tuple[RawMessage, ...]:
    """Read the messages that the probe or the simulator published.

    Raises:
        UsageError: The file cannot be read.
    """
    simulated = simulated_topics(recording)
    found: list[RawMessage] = []
    try:
        with file.open("rb") as stream:
            for schema, channel, message in make_reader(stream).iter_messages():
                if channel.message_encoding != "cdr" or schema is None:
                    continue
                sent = SENT in channel.metadata
                if not sent and channel.topic not in simulated:
                    continue
                found.append(
                    RawMessage(
                        topic=channel.topic,
                        type=schema.name,
                        cdr=message.data,
                        stamp_ns=message.publish_time,
                        received_ns=message.log_time,
                        sequence=message.sequence,
                        is_sent=sent,
                    )
                )
    except OSError as error:
        raise UsageError(f"{file}: {error.strerror or error}") from error
    return tuple(sorted(found, key=lambda message: message.stamp_ns))


def simulated_topics(recording: Recording) -> frozenset[str]:
    """Topics on which the simulator published."""
    scene = recording.scene
    return frozenset({scene.odometry_topic, scene.scan_topic} if scene else ())
