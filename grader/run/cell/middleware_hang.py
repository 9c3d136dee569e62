"""Whether a cell waits for its middleware, which is busy with what the student's processes send.

A single packet can keep the thread that receives it busy for hours: a heartbeat of RTPS that
announces 2^40 samples. Meanwhile it holds a lock that calls of rclpy wait for, some of them
without letting any other thread of Python run. So it can only be seen, and ended, from outside.
"""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

from grader.errors import GraderFault
from grader.recording.event import Breach
from grader.recording.model import Ending, Process, Recording
from grader.recording.submission import SubmissionRecord
from grader.run.order import CellOrder

ENDED_BY = signal.SIGALRM
"""The signal that ends a cell whose middleware hangs. Unlike SIGKILL, only rosgrade sends it."""
_TICKS_PER_S = os.sysconf("SC_CLK_TCK")
# As the names of Fast DDS' threads begin.
_MIDDLEWARE = b"(dds."
_BUSY_S = 5.0
"""CPU time that the middleware never takes at a stretch in an ordinary run."""


class MiddlewareHung(GraderFault):
    """The student's processes kept the cell's middleware busy, and it was ended for it."""


class HangMonitor:
    """Looks at one cell, again and again."""

    def __init__(self, task: Path) -> None:
        self._task = task
        self._waiting: tuple[bytes, ...] = ()
        self._before_s = 0.0

    def signal_to_send(self) -> signal.Signals | None:
        """The signal to end the cell with, or None."""
        return ENDED_BY if self._lasts() else None

    def _lasts(self) -> bool:
        """Whether the main thread has not run at all while others used more than 5 s of CPU."""
        try:
            waiting = _switches((self._task / "status").read_bytes())
            if waiting and waiting == self._waiting:
                return self._middleware_s() - self._before_s > _BUSY_S
            self._waiting, self._before_s = waiting, self._middleware_s()
        except OSError:
            # It has ended.
            return False
        return False

    def _middleware_s(self) -> float:
        total = 0
        for thread in (self._task / "task").iterdir():
            stat = (thread / "stat").read_bytes()
            if _MIDDLEWARE in stat:
                # The numbers of the fields are those of proc(5), less three.
                total += sum(map(int, stat.rpartition(b")")[2].split()[11:13]))
        return total / _TICKS_PER_S


def _switches(status: bytes) -> tuple[bytes, ...]:
    """How often a thread was taken from a CPU so far; nothing while it is on one or wants one."""
    lines = status.splitlines()
    if any(line.startswith(b"State:\tR") for line in lines):
        return ()
    return tuple(line for line in lines if b"ctxt_switches:" in line)


def hung_recording(order: CellOrder, submission: SubmissionRecord, launched_ns: int) -> Recording:
    """The recording of a run whose cell was ended: without any message."""
    now_ns = time.time_ns()
    breach = Breach(
        now_ns,
        "forbidden packets",
        "sent packets that keep the middleware of the node that watches the run busy for ever",
        "",
    )
    ended = [
        Process(command.name, 0, launched_ns, now_ns, -signal.SIGKILL) for command in order.commands
    ]
    return Recording(
        scenario=order.scenario,
        seed=order.seed,
        ending=Ending.EXITED,
        launched_ns=launched_ns,
        stop_ns=now_ns,
        end_ns=now_ns,
        submission=submission,
        processes=tuple(ended),
        breaches=(breach,),
        values=order.values,
        environment=order.environment,
        names=order.names,
    )
