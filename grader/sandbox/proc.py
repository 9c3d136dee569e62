"""Files of /proc that are read many times a second."""

from __future__ import annotations

import os

_MOST_BYTES = 65_536


def read_proc(path: str) -> bytes:
    """All of a small file of the kernel's, which hands it out in one piece.

    A file object of Python's would ask for its size and kind first, which takes three times as
    long as to read it.

    Raises:
        OSError: It is not there any more, or belongs to somebody else.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        return os.read(descriptor, _MOST_BYTES)
    finally:
        os.close(descriptor)
