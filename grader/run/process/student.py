"""The student's processes: started as ``ros2 run`` would, stopped in steps, none left behind."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from grader.recording.event import Breach
from grader.recording.model import NS, Process
from grader.run.host.disturbance import DisturbanceMeter
from grader.run.host.stopwatch import Stopwatch
from grader.run.order import RunLimits
from grader.run.process.descendants import (
    descendant_pids,
    is_stopped,
    kill_descendants,
    kill_tree,
    pid_within,
    reap,
    remove_orphaned_segments,
)
from grader.run.process.guard import Guard
from grader.run.process.output import OutputReader
from grader.run.process.process_sandbox import ProcessSandbox, SandboxedProcess
from grader.sandbox.seccomp import INIT, LEADER

_AFTERMATH_S = 0.5
_STOP_TICK_S = 0.005
_LOOK_S = 0.5
"""Time between two looks whether a process was stopped by a signal."""
_SUSPENDED_NS = NS // 2
"""What was stopped for so long will not go on by itself."""


class PlainProcess(subprocess.Popen[bytes]):
    """A process without a sandbox, with the properties of one in a sandbox."""

    init: int | None = None
    has_begun = was_set_up = True

    @property
    def exit_code(self) -> int | None:
        """As in :mod:`subprocess`."""
        return self.returncode

    def signal_group(self, number: signal.Signals) -> None:
        """Send a signal to its process group."""
        os.killpg(self.pid, number)


@dataclass
class _Running:
    name: str
    popen: PlainProcess | SandboxedProcess
    started_ns: int
    seen_fd: int | None
    pause_fd: int | None
    exited_ns: int | None = None
    asked: Stopwatch | None = None
    """Since it was sent the first signal to end."""
    stopped_by: str = "itself"
    stop_s: float | None = None
    suspended_ns: int | None = None
    stopped: Collection[int | None] = ()
    """What was killed because a signal had stopped it: ids in the sandbox, INIT for itself."""

    def end_if_suspended(self) -> None:
        """Kill it if a signal such as SIGSTOP stopped it some time ago: it would wait for ever."""
        init = self.popen.init
        own = (self.popen.pid, *([] if init is None else (init, *descendant_pids(init))))
        stopped = list(filter(is_stopped, own))
        if not stopped:
            self.suspended_ns = None
        elif self.suspended_ns is None:
            self.suspended_ns = time.time_ns()
        elif time.time_ns() - self.suspended_ns > _SUSPENDED_NS:
            self.stopped = {INIT if pid == self.popen.pid else pid_within(pid) for pid in stopped}
            kill_tree(self.popen.pid)

    def signal(self, number: signal.Signals, meter: DisturbanceMeter) -> None:
        """Send a signal to its process group, if that is still there."""
        self.asked = self.asked or Stopwatch(meter)
        with contextlib.suppress(ProcessLookupError):
            self.stopped_by = number.name
            self.popen.signal_group(number)

    @property
    def exit_code(self) -> int | None:
        """As in :mod:`subprocess`; of a process that was stopped, SIGSTOP ended it."""
        return -signal.SIGSTOP if self.stopped else self.popen.exit_code


class StudentProcesses:
    """All processes that a scenario launches."""

    def __init__(
        self,
        output: OutputReader,
        meter: DisturbanceMeter,
        process_sandbox: ProcessSandbox | None = None,
    ) -> None:
        self._output = output
        self._meter = meter
        self._sandbox = process_sandbox
        self._guard: Guard | None = None
        if process_sandbox is not None:
            try:
                program = Path(process_sandbox.guard).read_bytes()
                self._guard = Guard(program, process_sandbox.calls)
            except OSError:
                # A container around rosgrade watches system calls: all are refused, none is seen.
                self._sandbox = replace(process_sandbox, filter=process_sandbox.unguarded)
        self._running: list[_Running] = []
        self._pids: frozenset[int] = frozenset()
        self._survivors: tuple[str, ...] = ()
        self.others: frozenset[int] = frozenset()
        """Processes in this cell that are not the student's."""
        self._next_look_s = 0.0

    def launch(
        self,
        name: str,
        argv: tuple[str, ...],
        environment: Mapping[str, str],
        of_run: Mapping[str, str],
        folder: Path,
    ) -> None:
        """Start a process in a session of its own; variables ``of_run`` are added."""
        tracer_read, tracer_write = os.pipe()
        seen_read, seen_write = os.pipe()
        pause_read, pause_write = os.pipe()
        given = (tracer_write, seen_read, pause_read)
        try:
            variables = {
                **environment,
                **of_run,
                "ROSGRADE_TRACER_FD": str(tracer_write),
                "ROSGRADE_TRACER_PIPE": str(os.fstat(tracer_write).st_ino),
                "ROSGRADE_SEEN_FD": str(seen_read),
                "ROSGRADE_PAUSE_FD": str(pause_read),
            }
            popen = self._popen(argv, variables, folder, given)
        except OSError:
            for fd in (tracer_read, seen_write, pause_write):
                os.close(fd)
            raise
        finally:
            for fd in given:
                os.close(fd)
        self._running.append(_Running(name, popen, time.time_ns(), seen_write, pause_write))
        for pipe, stream in ((popen.stdout, "stdout"), (popen.stderr, "stderr")):
            assert pipe is not None
            self._output.add(os.dup(pipe.fileno()), name, stream)
            pipe.close()
        self._output.add(tracer_read, name, "tracer")
        self._pids |= {popen.pid}

    def _popen(
        self,
        argv: tuple[str, ...],
        variables: Mapping[str, str],
        folder: Path,
        pass_fds: tuple[int, ...],
    ) -> PlainProcess | SandboxedProcess:
        if self._sandbox is not None:
            start = partial(SandboxedProcess, self._sandbox, argv, variables, pass_fds)
            return self._guard.start(start) if self._guard is not None else start()
        return PlainProcess(
            argv,
            cwd=folder,
            env=variables,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            pass_fds=pass_fds,
            start_new_session=True,
        )

    @property
    def inits(self) -> tuple[int, ...]:
        """The first process of each sandbox that still stands."""
        inits = [one.popen.init for one in self._running if one.exited_ns is None]
        return tuple(init for init in inits if init is not None)

    @property
    def violations(self) -> tuple[str, ...]:
        """Forbidden system calls of the student's processes, as texts."""
        return self._guard.violations if self._guard is not None else ()

    @property
    def pids(self) -> frozenset[int]:
        """Every process that was launched or descends from one, ended ones too."""
        return self._pids

    @property
    def waiting(self) -> str | None:
        """A process whose program was not started yet, because its sandbox does not stand."""
        self.poll()
        return next((one.name for one in self._running if not one.popen.has_begun), None)

    def refresh(self) -> None:
        """Look for descendants that are not known yet."""
        self._pids |= frozenset(descendant_pids(os.getpid()))

    def poll(self) -> bool:
        """Note ended processes; whether any is still running."""
        looks = time.monotonic() >= self._next_look_s
        if looks:
            self._next_look_s = time.monotonic() + _LOOK_S
        for process in self._running:
            if looks and process.exited_ns is None and process.stopped_by == "itself":
                process.end_if_suspended()
            if process.exited_ns is None and process.popen.poll() is not None:
                process.exited_ns = time.time_ns()
                if process.asked is not None:
                    process.stop_s = process.asked.elapsed_s
        return any(process.exited_ns is None for process in self._running)

    def let_exit(self, name: str | None = None) -> None:
        """Let a process end, or all: their tracers wait until what they declared was seen."""
        for process in self._running:
            if name in (None, process.name) and process.seen_fd is not None:
                os.close(process.seen_fd)
                process.seen_fd = None

    def pause(self) -> None:
        """Let executors find nothing ready until :meth:`resume`."""
        for process in self._running:
            if process.pause_fd is not None:
                with contextlib.suppress(BrokenPipeError):
                    os.write(process.pause_fd, b".")

    def resume(self) -> None:
        """End a pause; there is one in a run at most."""
        for process in self._running:
            if process.pause_fd is not None:
                os.close(process.pause_fd)
                process.pause_fd = None

    def is_running(self, name: str) -> bool:
        """Whether a process of this name runs."""
        self.poll()
        return any(item.name == name and item.exited_ns is None for item in self._running)

    def was_killed(self, name: str) -> bool:
        """Whether the newest process of this name was ended by :meth:`kill`."""
        named = [item for item in self._running if item.name == name]
        return bool(named) and named[-1].asked is not None

    def kill(self, name: str, number: signal.Signals) -> bool:
        """Send a signal to the process group of one process, in the middle of the run."""
        self.let_exit(name)
        running = self.is_running(name)
        for process in self._running:
            if process.name == name and process.exited_ns is None:
                process.signal(number, self._meter)
        return running

    def stop(self, limits: RunLimits) -> None:
        """SIGINT, SIGTERM, SIGKILL, each with a bounded wait; dates the end of each process."""
        self.resume()
        self.let_exit()
        for number, limit_s in (
            (signal.SIGINT, limits.shutdown_s),
            (signal.SIGTERM, limits.terminate_s),
            (signal.SIGKILL, limits.terminate_s),
        ):
            if not self.poll():
                break
            for process in self._running:
                if process.exited_ns is None:
                    process.signal(number, self._meter)
            step = Stopwatch(self._meter)
            while self.poll() and step.measured_s <= limit_s:
                time.sleep(_STOP_TICK_S)

    def clean_up(self) -> None:
        """Kill all remaining processes and remove what they left in shared memory."""
        # Helpers such as multiprocessing's resource tracker end by themselves a moment later.
        deadline = time.monotonic() + _AFTERMATH_S
        while not self.poll() and descendant_pids(os.getpid()) and time.monotonic() < deadline:
            time.sleep(0.01)
        inits = {pid for pid in descendant_pids(os.getpid()) if pid_within(pid) == INIT}
        self._survivors = tuple(
            command
            for pid, command in kill_descendants(os.getpid()).items()
            if pid not in {*self.others, *inits, *(process.popen.pid for process in self._running)}
        )
        self.poll()
        reap()
        remove_orphaned_segments()
        if self._guard is not None:
            self._guard.close()

    def faults(self) -> tuple[str, ...]:
        """Sandboxes that could not be set up, one sentence each; call after :meth:`clean_up`."""
        return tuple(
            f"the sandbox of {process.name} could not be set up: "
            f"{' '.join(self._output.tail(process.name, 'stderr', 1)) or 'no message'}"
            for process in self._running
            if process.stopped_by == "itself"
            and not process.stopped
            and not process.popen.was_set_up
        )

    def ended_from_outside(self, breaches: Sequence[Breach]) -> str | None:
        """A sentence if something outside of its sandbox killed or stopped a process, or None.

        From within none can stop what holds the sandbox. What was started in it can be stopped in
        ways that the guard sees, and what that has started in others too: by a terminal of its
        own, or by the end of its parent.
        """
        if breaches or self._guard is None:
            return None
        # A sandbox's own processes end with the status of what was started in it.
        sandboxes = {pid for one in self._running for pid in (one.popen.pid, one.popen.init)}
        outside = {INIT} if self._guard.can_have_ended(sandboxes) else {INIT, LEADER}
        for process in self._running:
            code = process.exit_code
            ended = {LEADER} if code == -signal.SIGKILL else set(process.stopped)
            if process.stopped_by == "itself" and code is not None and outside & ended:
                name = signal.Signals(-code).name
                return f"{process.name} got {name} from outside its sandbox during the run"
        return None

    def records(self) -> tuple[Process, ...]:
        """The recorded facts of each process; call after :meth:`clean_up`."""
        return tuple(
            Process(
                name=process.name,
                pid=process.popen.pid,
                started_ns=process.started_ns,
                exited_ns=process.exited_ns,
                exit_code=process.exit_code,
                stopped_by=process.stopped_by,
                stop_s=process.stop_s,
                survivors=self._survivors if number == 0 else (),
                dropped_bytes=self._output.dropped_bytes(process.name),
            )
            for number, process in enumerate(self._running)
        )
