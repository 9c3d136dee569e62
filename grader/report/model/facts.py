"""Facts of a run that neither the grade nor a recording holds."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime


@dataclass(frozen=True)
class RunFacts:
    """How a grade came about.

    Attributes:
        started: When grading began, ISO 8601 with offset.
        duration_s: Wall time from then to the grade, in seconds.
        environment: ``ros_distro``, ``rmw``, ``python``, ``sandbox``, ...
        recordings: Scenario id -> its recording, as a path relative to the report.
    """

    started: str
    duration_s: float
    environment: Mapping[str, str] = field(default_factory=dict)
    rosgrade_version: str = ""
    recordings: Mapping[str, str] = field(default_factory=dict)
    runs: Mapping[str, int] = field(default_factory=dict)


class Clock:
    """Dates the beginning of the grading and measures how long it took."""

    def __init__(self) -> None:
        """Start now."""
        self.started = datetime.now().astimezone().isoformat(timespec="seconds")
        self._start_s = time.monotonic()

    @property
    def elapsed_s(self) -> float:
        """Wall time since the start, in seconds."""
        return time.monotonic() - self._start_s
