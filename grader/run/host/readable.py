"""Waiting for descriptors of any number; select(2) knows only those below 1024."""

from __future__ import annotations

import math
import select
from collections.abc import Collection


def readable(descriptors: Collection[int], limit_s: float | None = None) -> set[int]:
    """Wait until something can be read, or an end be seen.

    Args:
        limit_s: How long to wait at most.

    Returns:
        Those that can be read; none when the limit is over.
    """
    poll = select.poll()
    for descriptor in descriptors:
        poll.register(descriptor, select.POLLIN)
    found = poll.poll(None if limit_s is None else math.ceil(1000 * limit_s))
    return {descriptor for descriptor, _ in found}
