"""How long threads of the submission were ready to run and had no CPU: their run delay."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping, Sequence
from itertools import takewhile
from typing import NamedTuple

from grader.recording.model import NS
from grader.sandbox.proc import read_proc

_COMPUTES = 0.9
"""Share of its life that a thread runs or waits for a CPU, if all it does is to compute."""
_START_NS = NS
"""CPU time that a program may need to start: a node takes 0.4 s to import rclpy and be made."""


class Scheduled(NamedTuple):
    """How long a thread ran so far, and how long it waited for a CPU while it was ready to run."""

    ran_ns: int
    waited_ns: int


def scheduled(pid: int) -> dict[int, Scheduled]:
    """Each thread of a process by its id, from schedstat (the kernel's sched-stats.rst)."""
    threads: dict[int, Scheduled] = {}
    # It may end meanwhile.
    with contextlib.suppress(OSError):
        for name in os.listdir(f"/proc/{pid}/task"):  # noqa: PTH208  often
            with contextlib.suppress(OSError, IndexError, ValueError):
                text = read_proc(f"/proc/{pid}/task/{name}/schedstat")
                ran_ns, waited_ns, _ = map(int, text.split())
                threads[int(name)] = Scheduled(ran_ns, waited_ns)
    return threads


class Waits:
    """How long threads of the submission wait for a CPU.

    Those that do nothing but compute, more of them than there are CPUs, would wait on any machine.
    Once they have had more than their starts need, they explain no delay.
    """

    def __init__(self, cpus: int) -> None:
        self._cpus = cpus
        self._born_ns: dict[int, int] = {}
        self._waited_ns: dict[int, int] = {}

    def longest_ns(self, now_ns: int, threads: Mapping[int, Scheduled]) -> int:
        """The longest wait since the look before."""
        excluded = self._crowding(now_ns, threads)
        longest_ns = 0
        for thread, times in threads.items():
            waited_before_ns = self._waited_ns.get(thread, 0)
            self._waited_ns[thread] = times.waited_ns
            if thread not in excluded:
                longest_ns = max(longest_ns, times.waited_ns - waited_before_ns)
        return longest_ns

    def _crowding(self, now_ns: int, threads: Mapping[int, Scheduled]) -> set[int]:
        """Threads that do nothing but compute, where they are more than there are CPUs."""
        for thread, times in threads.items():
            self._born_ns.setdefault(thread, now_ns - sum(times))
        computing = {
            thread
            for thread, times in threads.items()
            if sum(times) >= _COMPUTES * (now_ns - self._born_ns[thread])
        }
        ran_ns = sum(threads[thread].ran_ns for thread in computing)
        have_started = ran_ns > _START_NS * len(computing)
        return computing if len(computing) > self._cpus and have_started else set()


def uncounted(waited_ns: int, end_ns: int, samples: Sequence[tuple[int, int, int]]) -> int:
    """How much of a wait that ended now no other thread's wait has counted for.

    Threads wait at the same time, but the time is lost once.

    Args:
        samples: Begin, end and counted wait of the samples before, without gaps, oldest first.
    """
    begin_ns = end_ns - waited_ns
    within = takewhile(lambda sample: sample[1] > begin_ns, reversed(samples))
    known = (min(counted, to - max(at, begin_ns)) for at, to, counted in within)
    return max(0, waited_ns - sum(known))


def beyond(late_ns: int, waited_ns: int, length_ns: int) -> int:
    """How late the probe was beyond what the student waited, in a sample of some length.

    A machine that stands still holds up both at once, and that is one delay.
    """
    return min(late_ns, max(length_ns, waited_ns, late_ns) - waited_ns)


def is_blocked(pid: int) -> bool:
    """Whether a process waits for the kernel, uninterruptibly: state D in proc_pid_stat(5)."""
    try:
        status = read_proc(f"/proc/{pid}/stat")
    except OSError:
        return False
    return status[status.rindex(b")") + 2 :].startswith(b"D")
