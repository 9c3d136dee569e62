"""Whether somebody set the machine's clock in the middle of a run.

Messages and log lines carry the time of day, as rclpy and DDS stamp them. After NTP, the host of a
virtual machine or a laptop's sleep has set that clock, nobody knows any more how much time lay
between two of them. A clock that is only slewed moves the monotonic one as well (adjtimex(2)).
"""

from __future__ import annotations

import time
from collections.abc import Callable

from grader.recording.model import NS

_READINGS = 20
_EXACT_NS = 20_000
_TRIFLE_NS = 10_000_000
"""Far below what tolerances on periods and delays allow."""


class WallClock:
    """Compares the time of day with a clock that nobody can set."""

    def __init__(
        self,
        wall_ns: Callable[[], int] = time.time_ns,
        steady_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        """Begin to compare."""
        self._wall_ns, self._steady_ns = wall_ns, steady_ns
        self._ahead_ns = self._read()

    @property
    def fault(self) -> str | None:
        """That the clock was set since the beginning, in words; None if it was not."""
        step_ns = self._read() - self._ahead_ns
        if abs(step_ns) <= _TRIFLE_NS:
            return None
        way = "forward" if step_ns > 0 else "back"
        return (
            f"the clock of this machine was set {way} by {abs(step_ns) / NS:.3g} s in the middle "
            "of the run (NTP does that, the host of a virtual machine, and sleep), so that no "
            "time that was recorded can be trusted"
        )

    def _read(self) -> int:
        """How far the time of day is ahead, from the tightest of a few readings."""
        best_ns: int | None = None
        ahead_ns = 0
        for _ in range(_READINGS):
            before_ns = self._steady_ns()
            wall_ns = self._wall_ns()
            took_ns = self._steady_ns() - before_ns
            if best_ns is None or took_ns < best_ns:
                best_ns, ahead_ns = took_ns, wall_ns - before_ns - took_ns // 2
            if best_ns <= _EXACT_NS:
                break
        return ahead_ns
