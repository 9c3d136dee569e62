"""Whether the cell waits for its middleware, which is busy with what the student's processes send.

A single packet can keep the thread that receives it busy for hours: a heartbeat of RTPS that
announces 2^40 samples. Meanwhile it holds a lock that every call of rclpy waits for.
"""

from __future__ import annotations

import os
import threading
import time

_TASKS = "/proc/self/task"
_TICKS_PER_S = os.sysconf("SC_CLK_TCK")
# As Fast DDS calls its threads that receive.
_RECEIVING = b"(dds.udp."
_STILL_S = 1.0
_BUSY_S = 5.0
"""CPU time that no run of good manners takes at a stretch."""


class Stall:
    """Told by the thread that runs the cell that it goes on, and asked by another one."""

    def __init__(self) -> None:
        """It goes on."""
        self._ticked_s = time.monotonic()
        self._before_s: float | None = None
        self._decided = threading.Lock()
        self._over = False

    def tick(self) -> None:
        """Tell that it goes on."""
        self._ticked_s = time.monotonic()

    def end(self) -> None:
        """Tell that nothing is asked of the middleware any more.

        Does not return where that comes too late, and the process is being ended.
        """
        self._decided.acquire()

    def lasts(self) -> bool:
        """Whether it waits, and will not be believed to go on any more."""
        if self._over or time.monotonic() - self._ticked_s < _STILL_S:
            self._before_s = None
            return False
        busy_s = _received_s()
        if self._before_s is None:
            self._before_s = busy_s
        self._over = busy_s - self._before_s > _BUSY_S and self._decided.acquire(blocking=False)
        return self._over


def _received_s() -> float:
    """CPU time that the middleware's receiving threads of this process took so far."""
    total = 0
    for task in os.listdir(_TASKS):  # noqa: PTH208  often
        try:
            with open(f"{_TASKS}/{task}/stat", "rb") as file:  # noqa: PTH123  often
                stat = file.read()
        except OSError:
            continue
        if _RECEIVING in stat:
            # The numbers of the fields are those of proc(5), less three.
            total += sum(map(int, stat.rpartition(b")")[2].split()[11:13]))
    return total / _TICKS_PER_S
