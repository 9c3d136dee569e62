"""Run delay: how long threads were ready to run but had no CPU."""

from __future__ import annotations

import os
from collections.abc import Collection

_LONGEST = 128
_MOST_OPEN = 128


class RunDelays:
    """Reads the run delay of threads, from schedstat in /proc.

    The second number there is the delay; see "sched-stats" in the kernel's documentation. It is
    read ten times a second: to open the file takes several times as long as to read it, so it
    stays open while the thread lives.
    """

    def __init__(self) -> None:
        """Nothing is open yet."""
        self._files: dict[tuple[int, int], int] = {}

    def read(self, pid: int) -> dict[int, int]:
        """Run delay of each thread of a process so far.

        Returns:
            Thread id -> nanoseconds; empty where nothing is known.
        """
        try:
            threads = {int(name) for name in os.listdir(f"/proc/{pid}/task")}  # noqa: PTH208  often
        except OSError:
            threads = set()
        for key in [key for key in self._files if key[0] == pid and key[1] not in threads]:
            os.close(self._files.pop(key))
        found = {thread: self._delay_ns(pid, thread) for thread in threads}
        return {thread: delay for thread, delay in found.items() if delay is not None}

    def forget(self, but: Collection[int] = ()) -> None:
        """Close the files of all processes but these."""
        for key in [key for key in self._files if key[0] not in but]:
            os.close(self._files.pop(key))

    def _delay_ns(self, pid: int, thread: int) -> int | None:
        file = self._files.get((pid, thread))
        try:
            if file is not None:
                return _read(file)
            file = os.open(f"/proc/{pid}/task/{thread}/schedstat", os.O_RDONLY)
            if len(self._files) < _MOST_OPEN:
                self._files[pid, thread] = file
                return _read(file)
            try:
                return _read(file)
            finally:
                os.close(file)
        except (OSError, IndexError, ValueError):
            # It has ended; another thread may get its number.
            if (pid, thread) in self._files:
                os.close(self._files.pop((pid, thread)))
            return None


def _read(file: int) -> int:
    return int(os.pread(file, _LONGEST, 0).split()[1])
