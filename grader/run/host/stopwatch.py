"""Time as a run is judged by: without what the host took meanwhile."""

from __future__ import annotations

import time

from grader.recording.event import LONGEST_STRETCH
from grader.run.host.disturbance import DisturbanceMeter


class Stopwatch:
    """Time since its start, less what the host took meanwhile."""

    def __init__(self, meter: DisturbanceMeter) -> None:
        self._meter = meter
        self._wall_s = time.monotonic()
        self._stolen_s = meter.stolen_s

    @property
    def elapsed_s(self) -> float:
        """Undisturbed seconds; at least an eighth of the wall time, so that every wait ends."""
        return self._undisturbed_s(time.monotonic())

    @property
    def measured_s(self) -> float:
        """The same until the last sample: what the machine took since then is not known yet."""
        return self._undisturbed_s(self._meter.sampled_s)

    def _undisturbed_s(self, now_s: float) -> float:
        wall_s = now_s - self._wall_s
        least_s = (time.monotonic() - self._wall_s) / LONGEST_STRETCH
        return max(wall_s - (self._meter.stolen_s - self._stolen_s), least_s)
