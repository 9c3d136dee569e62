"""Print what is in a bag, as JSON; runs in the sandbox, where rosgrade's own code is not."""

import json
import resource
import sys
from collections import Counter
from pathlib import Path

_MEMORY_BYTES = 2 * 2**30


def contents(bag: Path) -> dict[str, object]:
    """What is in a bag, by reading each of its messages."""
    from rosbags.rosbag2 import Reader

    messages: Counter[tuple[str, str]] = Counter()
    with Reader(bag) as reader:
        messages.update({(one.topic, one.msgtype): 0 for one in reader.connections})
        for connection, _, _ in reader.messages():
            messages[connection.topic, connection.msgtype] += 1
        duration_s = reader.duration / 1e9 if messages.total() else 0.0
    topics = [
        {"name": name, "type": kind, "messages": count}
        for (name, kind), count in sorted(messages.items())
    ]
    return {"duration_s": duration_s, "topics": topics}


def main(bag: str, cpu_s: str) -> None:
    """Read within limits of memory and CPU time."""
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (int(cpu_s), int(cpu_s)))
    try:
        found = contents(Path(bag))
    # A damaged file makes any of the libraries below raise anything.
    except Exception as error:
        found = {"problem": f"it cannot be read: {str(error)[:300] or type(error).__name__}"}
    print(json.dumps(found))


if __name__ == "__main__":
    main(*sys.argv[1:])
