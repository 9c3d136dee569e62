"""Print what is in a bag, as JSON; runs in the sandbox, where rosgrade's own code is not.

The messages of some types go into the file ``kept``: for each the number of its topic, when it was
recorded and published, its length, and its bytes.
"""

import json
import resource
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from struct import Struct
from typing import Any

_MEMORY_BYTES = 2 * 2**30
_MOST_KEPT, _MOST_KEPT_BYTES = 500_000, 64 * 2**20
_HEAD = Struct("<IqqI")
_ENDLESS_S = 2**31


def contents(bag: Path, kept_types: list[str] | None) -> dict[str, object]:
    """What is in a bag, by reading each of its messages.

    Args:
        kept_types: Of the messages that are kept; all of them without a list.
    """
    from rosbags.rosbag2 import Reader

    messages: Counter[tuple[str, str]] = Counter()
    kept_messages, kept_bytes, has_published = 0, 0, False
    with Reader(bag) as reader, Path("kept").open("wb") as kept:
        topics = {(one.topic, one.msgtype): one for one in reader.connections}
        numbers = {key: number for number, key in enumerate(sorted(topics))}
        messages.update(dict.fromkeys(topics, 0))
        for key, logged, published, data in _messages(reader):
            messages[key] += 1
            has_published |= logged != published
            if kept_types is None or key[1] in kept_types:
                kept_messages, kept_bytes = kept_messages + 1, kept_bytes + len(data)
                if kept_messages > _MOST_KEPT or kept_bytes > _MOST_KEPT_BYTES:
                    raise ValueError("more than 500,000 messages or 64 MiB of what is judged")
                kept.write(_HEAD.pack(numbers[key], logged, published, len(data)) + data)
        duration_s = reader.duration / 1e9 if messages.total() else 0.0
        said = reader.message_count
        return {
            "duration_s": duration_s,
            "distro": reader.ros_distro or "",
            "lost": max(0, said - messages.total()),
            "has_published": has_published,
            "topics": [
                {
                    "name": key[0],
                    "type": key[1],
                    "messages": messages[key],
                    "hash": _hash(topics[key]) if kept_types != [] else "",
                    "publishers": _profiles(topics[key].ext),
                }
                for key in sorted(topics)
            ],
        }


def _messages(reader: Any) -> Iterator[tuple[tuple[str, str], int, int, bytes]]:
    """Topic and type, times and bytes of each message, as it was recorded."""
    if any(file.path.suffix != ".mcap" for file in reader.storage.storages):
        for connection, at_ns, data in reader.messages():
            yield (connection.topic, connection.msgtype), at_ns, at_ns, data
        return
    from mcap.reader import make_reader
    from zstandard import ZstdDecompressor

    is_packed = reader.compression_mode == "message"
    for file in reader.storage.storages:
        with Path(file.path).open("rb") as stream:
            for schema, channel, one in make_reader(stream, validate_crcs=True).iter_messages():
                data = one.data
                if is_packed:
                    data = ZstdDecompressor().decompressobj().decompress(data)
                if schema is None:
                    raise ValueError(f"{channel.topic} has no type")
                # Before Jazzy nothing was known of when it was published.
                yield (
                    (channel.topic, schema.name),
                    one.log_time,
                    one.publish_time or one.log_time,
                    data,
                )


def _hash(connection: Any) -> str:
    """The hash of the type's definition (REP-2011), from the definition where it is not said."""
    if connection.digest:
        return str(connection.digest)
    from rosbags.interfaces import MessageDefinitionFormat
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    written, store = connection.msgdef, get_typestore(Stores.EMPTY)
    if written.format == MessageDefinitionFormat.NONE:
        return ""
    try:
        if written.format == MessageDefinitionFormat.MSG:
            store.register(get_types_from_msg(written.data, connection.msgtype))
        else:
            store.register(get_types_from_idl(written.data))
        return store.hash_rihs01(connection.msgtype)
    except Exception:
        return ""


def _profiles(ext: Any) -> list[dict[str, object]]:
    return [_profile(one) for one in ext.offered_qos_profiles]


def _profile(qos: Any) -> dict[str, object]:
    """The QoS of a publisher, in the words of the ROS docs."""

    def duration_s(time: Any) -> float | None:
        # rmw has the largest number for no limit, and zero for none given.
        is_limit = time.sec + time.nsec > 0 and time.sec < _ENDLESS_S - 1
        return time.sec + time.nsec / 1e9 if is_limit else None

    def policy(name: str, *known: str) -> str:
        value = str(getattr(qos, name).name.lower())
        return value if value in known else "unknown"

    return {
        "reliability": policy("reliability", "reliable", "best_effort"),
        "durability": policy("durability", "volatile", "transient_local"),
        "history": policy("history", "keep_last", "keep_all"),
        "liveliness": policy("liveliness", "automatic", "manual_by_topic"),
        "deadline_s": duration_s(qos.deadline),
        "lifespan_s": duration_s(qos.lifespan),
        "liveliness_lease_s": duration_s(qos.liveliness_lease_duration),
    }


def main(bag: str, cpu_s: str) -> None:
    """Read within limits of memory and CPU time."""
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (int(cpu_s), int(cpu_s)))
    try:
        found = contents(Path(bag), json.loads(Path("given").read_text()))
    # A damaged file makes any of the libraries below raise anything.
    except Exception as error:
        found = {"problem": f"it cannot be read: {str(error)[:300] or type(error).__name__}"}
    print(json.dumps(found))


if __name__ == "__main__":
    main(*sys.argv[1:])
