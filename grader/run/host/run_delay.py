"""Run delay: how long threads were ready to run but had no CPU."""

from __future__ import annotations

import contextlib
import os


def run_delays(pid: int) -> dict[int, int]:
    """Run delay of each thread of a process so far, from schedstat: thread id -> nanoseconds."""
    found: dict[int, int] = {}
    # It may end meanwhile.
    with contextlib.suppress(OSError):
        for name in os.listdir(f"/proc/{pid}/task"):  # noqa: PTH208  often
            with (
                contextlib.suppress(OSError, IndexError),
                open(f"/proc/{pid}/task/{name}/schedstat", "rb") as file,  # noqa: PTH123
            ):
                found[int(name)] = int(file.read().split()[1])
    return found
