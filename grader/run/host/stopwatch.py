"""Time that only counts while the host lets us run."""

from __future__ import annotations

import time

from grader.run.host.disturbance import DisturbanceMeter

_LONGEST_STRETCH = 8.0


class Stopwatch:
    """Time since its start, less what the host took from us meanwhile."""

    def __init__(self, meter: DisturbanceMeter) -> None:
        self._meter = meter
        self._wall_s = time.monotonic()
        self._stolen_s = meter.stolen_s

    @property
    def elapsed_s(self) -> float:
        """Undisturbed seconds; at least an eighth of the wall time, so that every wait ends."""
        wall_s = time.monotonic() - self._wall_s
        return max(wall_s - (self._meter.stolen_s - self._stolen_s), wall_s / _LONGEST_STRETCH)
