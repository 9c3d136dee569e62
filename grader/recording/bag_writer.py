"""Bags as ``ros2 bag record`` writes them: for mutants of a bag, examples, and tests."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType
from mcap.writer import Writer as McapFile

from grader.recording.bag import BagChannel, BagMessage
from grader.recording.model import Qos

_ENDLESS = (2**31 - 1, 999_999_999)


def write_bag(
    folder: Path,
    messages: Iterable[BagMessage],
    definitions: Mapping[str, str],
    storage: str = "mcap",
) -> None:
    """Write messages into a new bag, in the order of their recording.

    Args:
        definitions: Of each type, with those of all types in it; empty if the bag has none.
        storage: ``mcap``, or ``sqlite3``, which does not keep when a message was published.
    """
    from rosbags.rosbag2 import StoragePlugin, Writer

    plugin = StoragePlugin[storage.upper()]
    in_order = sorted(messages, key=lambda message: message.recorded_ns)
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        connections: dict[BagChannel, Any] = {}
        for message in in_order:
            channel = message.channel
            if channel not in connections:
                connections[channel] = writer.add_connection(
                    channel.name,
                    channel.type,
                    msgdef=definitions.get(channel.type, ""),
                    rihs01=channel.hash,
                    offered_qos_profiles=[_profile(qos) for qos in channel.publishers],
                )
            writer.write(connections[channel], message.recorded_ns, message.cdr)
    metadata = folder / "metadata.yaml"
    text = metadata.read_text("utf-8").replace("ros_distro: rosbags", "ros_distro: jazzy")
    metadata.write_text(text, "utf-8")
    if storage == "mcap":
        # rosbags writes one time only.
        _write_mcap(folder / f"{folder.name}.mcap", in_order, definitions)


def _write_mcap(file: Path, messages: Iterable[BagMessage], definitions: Mapping[str, str]) -> None:
    with file.open("wb") as stream:
        writer = McapFile(stream, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library="rosgrade")
        ids: dict[BagChannel, int] = {}
        for message in messages:
            channel = message.channel
            if channel not in ids:
                text = definitions.get(channel.type, "").encode()
                schema = writer.register_schema(channel.type, "ros2msg", text)
                ids[channel] = writer.register_channel(channel.name, "cdr", schema)
            recorded_ns, published_ns = message.recorded_ns, message.published_ns
            writer.add_message(ids[channel], recorded_ns, message.cdr, published_ns)
        writer.finish()  # type: ignore[no-untyped-call]


def read_bag(folder: Path) -> tuple[list[BagMessage], dict[str, str]]:
    """The messages of a bag that is the author's own, and the definitions of their types."""
    from mcap.reader import make_reader
    from rosbags.rosbag2 import Reader

    messages: list[BagMessage] = []
    with Reader(folder) as reader:
        definitions = {one.msgtype: one.msgdef.data for one in reader.connections}
        channels = {
            (one.topic, one.msgtype): BagChannel(
                one.topic,
                one.msgtype,
                one.digest,
                tuple(map(_qos, getattr(one.ext, "offered_qos_profiles", ()))),
            )
            for one in reader.connections
        }
        files = sorted(folder.glob("*.mcap"))
        # rosbags reads one time only, and SQLite has no other.
        for connection, time_ns, data in () if files else reader.messages():
            key = connection.topic, connection.msgtype
            messages.append(BagMessage(channels[key], time_ns, time_ns, bytes(data)))
    for file in files:
        with file.open("rb") as stream:
            for schema, channel, record in make_reader(stream).iter_messages():
                of_channel = channels[channel.topic, schema.name if schema else ""]
                times_ns = record.log_time, record.publish_time
                messages.append(BagMessage(of_channel, *times_ns, record.data))
    return messages, definitions


def _profile(qos: Qos) -> Any:
    from rosbags.interfaces import Qos as Profile
    from rosbags.interfaces import (
        QosDurability,
        QosHistory,
        QosLiveliness,
        QosReliability,
        QosTime,
    )

    endless = QosTime(*_ENDLESS)
    return Profile(
        QosHistory[qos.history.upper()],
        qos.depth or 0,
        QosReliability[qos.reliability.upper()],
        QosDurability[qos.durability.upper()],
        endless,
        endless,
        QosLiveliness[qos.liveliness.upper()],
        endless,
        False,
    )


def _qos(profile: Any) -> Qos:
    return Qos(
        reliability=profile.reliability.name.lower(),
        durability=profile.durability.name.lower(),
        history=profile.history.name.lower(),
        liveliness=profile.liveliness.name.lower(),
    )
