"""Events of a run: actions of the scenario on processes, limits, waits, disturbance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Intervention:
    """An action of the scenario on a process of the student.

    Attributes:
        time_ns: When.
        process: ``package/executable``.
        action: ``kill`` (a signal was sent) or ``restart`` (it was started again).
        signal: Name of the signal, or empty.
    """

    time_ns: int
    process: str
    action: str
    signal: str = ""


_ENDING = (
    *("memory", "cpu time", "open files", "descriptors in flight", "escaped processes"),
    *("sessions", "output"),
)


@dataclass(frozen=True)
class Breach:
    """A limit of the sandbox that the student's processes reached, or a forbidden action.

    Attributes:
        time_ns: When it was first seen.
        what: A limit such as ``memory`` or ``open files``; else ``forbidden call``, ``forbidden
            name``, ``forbidden packets`` or ``forged report``.
        taken: Such as ``1056 MiB of memory``; without a limit such as ``called `reboot```.
        allowed: Such as ``1024 MiB``; empty where there is no limit, because it is never allowed.
    """

    time_ns: int
    what: str
    taken: str
    allowed: str

    @property
    def ended(self) -> bool:
        """Whether the processes were ended for it; the kernel itself bounds the others."""
        return not self.allowed or self.what in _ENDING

    @property
    def violation(self) -> str:
        """The forbidden action, as the end of a sentence about the processes."""
        if not self.allowed:
            return f"{self.taken}, which is never allowed"
        return f"took {self.taken}, {self.allowed} are allowed"

    def __str__(self) -> str:
        """Write it in words."""
        return f"its processes {self.violation}"


LONGEST_STRETCH = 8.0
"""A limit without delays of the machine is over after so many times as long, whatever it took."""


@dataclass(frozen=True)
class Wait:
    """A bounded wait of the probe and how it ended.

    Attributes:
        what: Such as ``a publisher on /cmd_vel``.
        limit_s: How long it would have lasted at most, host disturbance not counted.
        began_ns: When it began.
        met_ns: When it was met, or None.
    """

    what: str
    limit_s: float
    began_ns: int
    met_ns: int | None = None


@dataclass(frozen=True)
class Pause:
    """The moment after the observation in which executors find nothing ready.

    If a message is published in this moment, no executor has called the code that publishes it.

    Attributes:
        began_ns: When the processes were told; their executors follow when they wait again.
        ended_ns: When they were stopped; no later where all had ended by themselves.
        received: Topic -> when messages on it were received meanwhile.
    """

    began_ns: int
    ended_ns: int
    received: Mapping[str, tuple[int, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class Disturbance:
    """Delays of the machine since the previous sample.

    Attributes:
        time_ns: When the sample was taken.
        late_ns: How much later the probe's metronome woke up than it asked to.
        waited_ns: How long the worst thread of the student waited for a CPU while it was ready
            to run (the kernel's run delay, /proc/PID/schedstat).

    Both without the time that the student's own processes took from each other. What held up both
    at once is in one of them.
    """

    time_ns: int
    late_ns: int
    waited_ns: int
