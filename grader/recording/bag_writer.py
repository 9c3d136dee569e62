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
    kept = sorted(messages, key=lambda one: one.recorded_ns)
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        connections: dict[BagChannel, Any] = {}
        for one in kept:
            if one.channel not in connections:
                connections[one.channel] = writer.add_connection(
                    one.channel.name,
                    one.channel.type,
                    msgdef=definitions.get(one.channel.type, ""),
                    rihs01=one.channel.hash,
                    offered_qos_profiles=[_profile(qos) for qos in one.channel.publishers],
                )
            writer.write(connections[one.channel], one.recorded_ns, one.cdr)
    metadata = folder / "metadata.yaml"
    text = metadata.read_text("utf-8").replace("ros_distro: rosbags", "ros_distro: jazzy")
    metadata.write_text(text, "utf-8")
    if storage == "mcap":
        # rosbags writes one time only.
        _write_mcap(folder / f"{folder.name}.mcap", kept, definitions)


def _write_mcap(file: Path, messages: Iterable[BagMessage], definitions: Mapping[str, str]) -> None:
    with file.open("wb") as stream:
        writer = McapFile(stream, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library="rosgrade")
        channels: dict[BagChannel, int] = {}
        for one in messages:
            if one.channel not in channels:
                text = definitions.get(one.channel.type, "").encode()
                schema = writer.register_schema(one.channel.type, "ros2msg", text)
                channels[one.channel] = writer.register_channel(one.channel.name, "cdr", schema)
            times = one.recorded_ns, one.cdr, one.published_ns
            writer.add_message(channels[one.channel], *times)
        writer.finish()  # type: ignore[no-untyped-call]


def read_bag(folder: Path) -> tuple[list[BagMessage], dict[str, str]]:
    """The messages of a bag that is the author's own, and the definitions of their types."""
    from mcap.reader import make_reader
    from rosbags.rosbag2 import Reader

    found: list[BagMessage] = []
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
        if files := sorted(folder.glob("*.mcap")):
            for file in files:
                with file.open("rb") as stream:
                    for schema, channel, one in make_reader(stream).iter_messages():
                        key = channel.topic, schema.name if schema else ""
                        times = one.log_time, one.publish_time
                        found.append(BagMessage(channels[key], *times, one.data))
        else:
            for connection, at_ns, data in reader.messages():
                key = connection.topic, connection.msgtype
                found.append(BagMessage(channels[key], at_ns, at_ns, bytes(data)))
    return found, definitions


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
