"""A student's process in a sandbox of its own, within the cell's.

The cell starts bubblewrap, which starts an init and, as its child, what is to be run. All that
the student starts are descendants of that init; a signal to its process group reaches the
student's process as one to an own session does without a sandbox, because an init is deaf to it.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import signal
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from grader.run.process.descendants import descendant_pids
from grader.sandbox.limits import SandboxLimits

WORKSPACE = "/ws"
"""Where a student sees what is installed."""
HOME = "/home/student"

# A shell reports a signal so, and bubblewrap does as well.
_SIGNALLED = 128
_STATUS_BYTES = 4096
_AROUND = 1024
"""Room for the processes and threads of the cell, and of the other sandboxes in it."""
_FORMATS = (b"\x7fELF", b"#!")


@dataclass(frozen=True)
class ProcessSandbox:
    """Everything with which a cell puts a process of the student into a sandbox.

    Attributes:
        arguments: Of bubblewrap.
        filter: File with the filter of system calls within the sandbox.
        unguarded: File with that filter where the guard cannot listen.
        guard: File with the filter that asks the guard.
        calls: Numbers of the calls that the guard knows.
        folders: What a student sees at a path -> where the cell finds it.
    """

    arguments: tuple[str, ...]
    filter: str
    unguarded: str
    guard: str
    calls: dict[str, int]
    limits: SandboxLimits
    folders: dict[str, str]

    def outside(self, path: str) -> Path:
        """Where the cell finds what a student sees at a path."""
        for inside, folder in self.folders.items():
            if Path(path).is_relative_to(inside):
                return Path(folder, Path(path).relative_to(inside))
        return Path(path)


class SandboxedProcess(subprocess.Popen[bytes]):
    """A process that is started in a sandbox; its exit code is that of what was started in it."""

    def __init__(
        self,
        process_sandbox: ProcessSandbox,
        argv: Sequence[str],
        environment: Mapping[str, str],
        pass_fds: Sequence[int],
    ) -> None:
        if argv[0].startswith(f"{WORKSPACE}/"):
            _check_executable(process_sandbox.outside(argv[0]))
        self._status, status = os.pipe()
        os.set_blocking(self._status, False)
        self._written = b""
        self._init: int | None = None
        self._has_begun = False
        arguments = [*process_sandbox.arguments, "--clearenv"]
        for name, value in environment.items():
            arguments += ["--setenv", name, value]
        given = _temporary("\0".join((*arguments, "")).encode())
        rules = os.open(process_sandbox.filter, os.O_RDONLY | os.O_CLOEXEC)
        try:
            super().__init__(
                [
                    # The sandbox's own first process has limits as well. What is in it inherits
                    # them, but for what the kernel counts for each user namespace.
                    *process_sandbox.limits.prlimit(_AROUND),
                    *("bwrap", "--args", str(given), "--json-status-fd", str(status)),
                    *("--seccomp", str(rules), "--"),
                    *("prlimit", f"--nproc={process_sandbox.limits.processes}", "--", *argv),
                ],
                cwd="/",
                env={"PATH": "/usr/bin:/bin"},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                pass_fds=(*pass_fds, given, rules, status),
                start_new_session=True,
            )
        finally:
            for descriptor in (given, rules, status):
                os.close(descriptor)

    @property
    def init(self) -> int | None:
        """First process of the sandbox; None before there is one."""
        if self._init is None:
            pid = self._read_status().get("child-pid")
            self._init = pid if isinstance(pid, int) else None
        return self._init

    @property
    def has_begun(self) -> bool:
        """Whether the sandbox stands and what is to be run in it was started, ended or not."""
        if not self._has_begun:
            init = self.init
            self._has_begun = self.poll() is not None or bool(init and descendant_pids(init))
        return self._has_begun

    @property
    def was_set_up(self) -> bool:
        """Whether the sandbox stood and the student's program was started; asked at its end."""
        return "exit-code" in self._read_status()

    @property
    def exit_code(self) -> int | None:
        """As in :mod:`subprocess`: negative for the signal that ended it."""
        code = self.returncode
        if code is not None and code > _SIGNALLED and code - _SIGNALLED in set(signal.Signals):
            return _SIGNALLED - code
        return code

    def signal_group(self, number: signal.Signals) -> None:
        """Send a signal to the student's process group."""
        init = self.init
        if init is None and number is not signal.SIGKILL:
            raise ProcessLookupError
        if init is None or number is not signal.SIGKILL:
            os.killpg(init or self.pid, number)
            return
        # Without its init everything would be gone, and what was left behind unknown.
        for pid in descendant_pids(init):
            with contextlib.suppress(ProcessLookupError):
                if os.getpgid(pid) == init:
                    os.kill(pid, number)

    def _read_status(self) -> dict[str, Any]:
        with contextlib.suppress(OSError):
            while block := os.read(self._status, _STATUS_BYTES):
                self._written += block
        found: dict[str, Any] = {}
        # The last line may not be there in full yet.
        with contextlib.suppress(ValueError):
            for line in self._written.splitlines():
                found.update(json.loads(line))
        return found


def _check_executable(path: Path) -> None:
    """Raise the error that the kernel would give at the start of a program."""
    with path.open("rb") as file:
        begin = file.read(4)
    if not begin.startswith(_FORMATS):
        raise OSError(errno.ENOEXEC, os.strerror(errno.ENOEXEC))
    if not os.access(path, os.X_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))


def _temporary(data: bytes) -> int:
    descriptor = os.memfd_create("arguments")
    os.write(descriptor, data)
    os.lseek(descriptor, 0, os.SEEK_SET)
    return descriptor
