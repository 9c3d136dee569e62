"""Run a command bounded in time and output, and leave nothing of it behind."""

from __future__ import annotations

import contextlib
import os
import selectors
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from grader.errors import GraderFault
from grader.sandbox.usage import Usage, usage_of
from grader.submission.build.own_time import OwnTime

_SUPERVISOR = Path(__file__).with_name("supervise.py")
_CHUNK = 64 * 1024
_KILL_S = 15.0
_POLL_S = 0.25
_LONGEST_LINE = 4096
_LONGEST_STRETCH = 8.0
"""Wall time, as a multiple of the time that a command may have for itself, until it is given up."""


@dataclass(frozen=True)
class OutputLimits:
    """How many bytes of the output are kept at its beginning and end, and how many end it."""

    head: int = 64 * 1024
    tail: int = 64 * 1024
    total: int = 64 * 1024 * 1024


class CappedOutput:
    """The beginning and the end of a stream, and how much was left out between them."""

    def __init__(self, limits: OutputLimits, on_line: Callable[[str], None] | None = None) -> None:
        """Start empty; ``on_line`` is called with each complete line."""
        self.limits = limits
        self.total = 0
        self._on_line = on_line
        self._head = bytearray()
        self._tail = bytearray()
        self._unfinished = b""

    def feed(self, data: bytes) -> None:
        """Take the next bytes of the stream."""
        self.total += len(data)
        room = self.limits.head - len(self._head)
        self._head += data[:room]
        self._tail += data[room:]
        if len(self._tail) > 2 * self.limits.tail:
            del self._tail[: -self.limits.tail]
        if self._on_line is not None:
            *complete, last = (self._unfinished + data).split(b"\n")
            # An endless line must not be kept; its end says most.
            self._unfinished = last[-_LONGEST_LINE:]
            for line in complete:
                self._on_line(line[-_LONGEST_LINE:].decode("utf-8", "replace"))

    def text(self) -> str:
        """What was kept, as text; a line in the middle says how much is missing."""
        tail = self._tail[-self.limits.tail :]
        missing = self.total - len(self._head) - len(tail)
        gap = f"\n[... {missing} bytes left out ...]\n".encode() if missing else b""
        return bytes(self._head + gap + tail).decode("utf-8", "replace")


@dataclass(frozen=True)
class Outcome:
    """How a command ended.

    Attributes:
        status: Exit status, or minus the signal's number, or None if it passed a limit.
        ended_by_us: The limit that it passed: ``time``, ``output`` or what ``excess`` returned.
        waited: Whether it computed in less than half of the time that it had for itself.
    """

    status: int | None
    ended_by_us: str | None
    output: str
    duration_s: float
    waited: bool = False


class Starved(GraderFault):
    """The machine gave a command too little time to say how it ends; later it may."""


@dataclass(frozen=True)
class Command:
    """A program to run, with its arguments, in a folder."""

    arguments: Sequence[str]
    folder: Path
    environment: Mapping[str, str]


def run_bounded(
    command: Command,
    *,
    wall_s: float,
    output: OutputLimits | None = None,
    on_line: Callable[[str], None] | None = None,
    excess: Callable[[Sequence[Usage]], str | None] = lambda _: None,
) -> Outcome:
    """Run a command and wait until it and everything that it started is gone.

    Args:
        wall_s: Most wall time, less what the machine takes of it: see :class:`OwnTime`. Stalls of
            disks are taken off up to as much again.
        excess: Called several times a second with what all its processes take; names the limit
            that was passed, which ends the command.

    Raises:
        Starved: It did not end, and the machine had no time for it.
    """
    limits = output or OutputLimits()
    kept = CappedOutput(limits, on_line)
    started = time.monotonic()
    clock = OwnTime(disk_s=wall_s)
    with _supervised(command) as process:
        ended_by_us = _drain(process, kept, _watch(process, clock, wall_s, excess))
    return Outcome(
        status=None if ended_by_us else process.returncode,
        ended_by_us=ended_by_us,
        output=kept.text(),
        duration_s=time.monotonic() - started,
        waited=clock.computed_s < clock.own_s / 2,
    )


def _watch(
    process: subprocess.Popen[bytes],
    clock: OwnTime,
    wall_s: float,
    excess: Callable[[Sequence[Usage]], str | None],
) -> Callable[[float], str | None]:
    """A function that looks at a command, so much later than due; names a limit that it passed."""

    def look(late_s: float) -> str | None:
        usages = usage_of([process.pid])
        clock.look(usages, late_s)
        passed = excess(usages)
        # What has ended was in time, also where this process was stopped meanwhile.
        if passed is not None or process.poll() is not None:
            return passed
        if clock.own_s > wall_s:
            return "time"
        if clock.wall_s > _LONGEST_STRETCH * wall_s:
            raise Starved(
                "this machine has too little time for it: after "
                f"{clock.wall_s / 60:.0f} min a program that may take {wall_s:.0f} s had got "
                f"{clock.computed_s:.0f} s of CPU time. Grade again when less runs here"
            )
        return None

    return look


@contextlib.contextmanager
def _supervised(command: Command) -> Iterator[subprocess.Popen[bytes]]:
    """The process that runs the command; afterwards it is gone, and all that it started."""
    try:
        process = subprocess.Popen(
            [sys.executable, "-I", "-S", str(_SUPERVISOR), *command.arguments],
            cwd=command.folder,
            env=dict(command.environment),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            bufsize=0,
        )
    except OSError as error:
        raise GraderFault(f"{command.arguments[0]} could not be started: {error}") from error
    try:
        yield process
    finally:
        # Closing its input makes the supervisor kill everything, also on Ctrl-C here.
        _close(process.stdin)
        try:
            process.wait(_KILL_S)
        except subprocess.TimeoutExpired as error:
            process.kill()
            process.wait()
            raise GraderFault("processes of a command could not be killed") from error
        finally:
            _close(process.stdout)


def _drain(
    process: subprocess.Popen[bytes],
    kept: CappedOutput,
    look: Callable[[float], str | None],
) -> str | None:
    """Take the output until the supervisor has ended; the limit that was passed, or None."""
    assert process.stdout is not None
    due = time.monotonic() + _POLL_S
    with selectors.DefaultSelector() as selector:
        selector.register(process.stdout, selectors.EVENT_READ)
        while True:
            # Asked first: what was written until its end is there to be read afterwards.
            is_gone = process.poll() is not None
            remaining = max(0.0, due - time.monotonic())
            if selector.select(0.0 if is_gone else remaining):
                block = os.read(process.stdout.fileno(), _CHUNK)
                if not block:
                    return None
                kept.feed(block)
                if kept.total > kept.limits.total:
                    return "output"
            elif is_gone:
                # A daemon holds the pipe although the supervisor is gone.
                return None
            late_s = time.monotonic() - due
            if late_s >= 0.0:
                passed = look(late_s)
                if passed is not None:
                    return passed
                due = time.monotonic() + _POLL_S


def _close(stream: IO[bytes] | None) -> None:
    if stream is not None:
        with contextlib.suppress(OSError):
            stream.close()
