"""Watches what the student's processes take in a sandbox, beyond what the kernel bounds itself.

The kernel's limits are per process. Here all are counted together several times a second, and
ended when they take too much, or when they do what is never allowed.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from grader.recording.event import Breach
from grader.run.process.descendants import send
from grader.sandbox.cpu_time import OrphanCpu
from grader.sandbox.limits import MIB, SandboxLimits, size_words
from grader.sandbox.memory import hidden_bytes, memory_bytes, own_bytes
from grader.sandbox.namespaces import STUDENT
from grader.sandbox.usage import files_in_flight, open_files, usage_of

_POLL_S = 0.1
_LOOKS_PER_SEARCH = 5
"""What is mapped takes longer to read than what is resident."""
_OWN_BYTES = 2048 * MIB
"""Memory that the cell itself may take: messages wait in it."""
_FULL = 0.99
# Some for ordinary subprocesses; every session gets a share of the CPU of its own.
_MOST_SESSIONS = 16
_MOST_IN_FLIGHT = 64
_JUST_ENDED = 8


class Watchdog:
    """Looks from a thread of its own until it is stopped.

    Args:
        violations: Forbidden actions so far, each with its kind and a text.
    """

    def __init__(
        self,
        limits: SandboxLimits,
        inits: Callable[[], Sequence[int]],
        output_bytes: Callable[[], int],
        violations: Callable[[], Iterable[tuple[str, str]]] = tuple,
    ) -> None:
        self._limits = limits
        self._inits = inits
        self._output_bytes = output_bytes
        self._violations = violations
        self._breaches: dict[str, Breach] = {}
        self._looks = 0
        self._hidden_bytes = 0
        self._cpu = OrphanCpu()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="watchdog", daemon=True)

    def start(self) -> None:
        """Begin to look."""
        self._thread.start()

    def stop(self) -> tuple[Breach, ...]:
        """Stop to look; return the limits that were passed."""
        self._stop.set()
        self._thread.join()
        self._look()
        return tuple(self._breaches.values())

    def _run(self) -> None:
        while not self._stop.wait(_POLL_S):
            self._look()

    def _look(self) -> None:
        limits = self._limits
        inits = self._inits()
        usages = usage_of(inits)
        if self._looks % _LOOKS_PER_SEARCH == 0:
            room = limits.memory_bytes - memory_bytes(usages, limits.memory_bytes)
            self._hidden_bytes = hidden_bytes(usages, room)
            if files_in_flight(usages) > _MOST_IN_FLIGHT:
                words = f"more than {_MOST_IN_FLIGHT} descriptors on their way between processes"
                self._end_all("descriptors in flight", words, str(_MOST_IN_FLIGHT))
        self._looks += 1
        taken = memory_bytes(usages, limits.memory_bytes, self._hidden_bytes)
        if taken > limits.memory_bytes:
            words = f"{size_words(taken)} of memory"
            self._end_all("memory", words, size_words(limits.memory_bytes))
        own = own_bytes()
        if own > _OWN_BYTES:
            words = f"{size_words(own)} of memory where messages wait"
            self._end_all("memory", words, size_words(_OWN_BYTES))
        if self._cpu.used_s(usages) > limits.cpu_s:
            words = f"more than {limits.cpu_s} s of CPU time"
            self._end_all("cpu time", words, f"{limits.cpu_s} s")
        threads = sum(usage.threads for usage in usages)
        # The last ones that it may start count as too many: no more can be seen.
        if threads >= limits.processes:
            self._note("processes", f"{threads} processes and threads", str(limits.processes))
        if threads > limits.processes * len(inits) + _JUST_ENDED:
            # More than the kernel lets them start: one of them has got around it.
            words = f"{threads} processes and threads"
            self._end_all("escaped processes", words, str(limits.processes))
        files = open_files(usages)
        if files > limits.open_files:
            self._end_all("open files", f"{files} open files", str(limits.open_files))
        if len({usage.session for usage in usages}) > _MOST_SESSIONS:
            words = f"more than {_MOST_SESSIONS} sessions"
            self._end_all("sessions", words, str(_MOST_SESSIONS))
        written = self._output_bytes()
        if written > limits.output_bytes:
            allowed = size_words(limits.output_bytes)
            self._end_all("output", f"{size_words(written)} of output", allowed)
        for kind, violation in self._violations():
            self._end_all(kind, violation, "")
        self._look_at(STUDENT / "disk", "disk", "/tmp and home")
        self._look_at(STUDENT / "shared", "shared memory", "/dev/shm")

    def _look_at(self, place: Path, what: str, name: str) -> None:
        status = os.statvfs(place)
        size, free = status.f_blocks * status.f_frsize, status.f_bfree * status.f_frsize
        if free < (1 - _FULL) * size:
            self._note(what, f"all space in {name}", size_words(size))
        if status.f_ffree < (1 - _FULL) * status.f_files:
            self._note(f"files in {what}", f"all files of {name}", str(status.f_files))

    def _note(self, what: str, taken: str, allowed: str) -> None:
        self._breaches.setdefault(what, Breach(time.time_ns(), what, taken, allowed))

    def _end_all(self, what: str, taken: str, allowed: str) -> None:
        self._note(what, taken, allowed)
        send(signal.SIGKILL, self._inits())
