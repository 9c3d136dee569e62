"""Shared memory that killed nodes leave: Fast DDS removes its segments only at a clean end.

A living participant holds a lock on ``fastrtps_<hex>_el`` beside each of its segments in /dev/shm;
without one the owner is dead. ``fastdds shm clean`` decides in the same way.
"""

from __future__ import annotations

import fcntl
import os
import re
import time
from pathlib import Path

_SHARED_MEMORY = Path("/dev/shm")
_LOCK = re.compile(r"fastrtps_[0-9a-f]{16}_el")
# A participant makes the file before it locks it.
_YOUNGEST_S = 1.0


def remove_orphaned_segments() -> None:
    """Remove the segments of this user's dead participants."""
    for lock in _SHARED_MEMORY.glob("fastrtps_*_el"):
        if _LOCK.fullmatch(lock.name) and _is_orphaned(lock):
            lock.with_name(lock.name.removesuffix("_el")).unlink(missing_ok=True)
            lock.unlink(missing_ok=True)


def _is_orphaned(lock: Path) -> bool:
    try:
        status = lock.stat()
        if status.st_uid != os.getuid() or time.time() - status.st_ctime < _YOUNGEST_S:
            return False
        with lock.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
