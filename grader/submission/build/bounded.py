"""Run a command of unknown manners: bounded in time and output, nothing left behind."""

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

_SUPERVISOR = Path(__file__).with_name("supervise.py")
_CHUNK = 64 * 1024
_KILL_S = 15.0
_POLL_S = 0.25
_FROZEN_S = 2.0
"""Who looks again only after this time was stopped meanwhile, and perhaps everybody else was."""
_LONGEST_LINE = 4096


@dataclass(frozen=True)
class OutputLimits:
    """How much of the output is kept, and how much ends the command.

    Attributes:
        head: Bytes kept of its beginning.
        tail: Bytes kept of its end.
    """

    head: int = 64 * 1024
    tail: int = 64 * 1024
    total: int = 64 * 1024 * 1024


class CappedOutput:
    """The beginning and the end of a stream, and how much was left out between them."""

    def __init__(self, limits: OutputLimits) -> None:
        """Start empty."""
        self._limits = limits
        self._head = bytearray()
        self._tail = bytearray()
        self.total = 0

    def feed(self, data: bytes) -> None:
        """Take the next bytes of the stream."""
        self.total += len(data)
        room = self._limits.head - len(self._head)
        self._head += data[:room]
        self._tail += data[room:]
        if len(self._tail) > 2 * self._limits.tail:
            del self._tail[: -self._limits.tail]

    def text(self) -> str:
        """What was kept, as text; a line in the middle says how much is missing."""
        tail = self._tail[-self._limits.tail :]
        missing = self.total - len(self._head) - len(tail)
        gap = f"\n[... {missing} bytes left out ...]\n".encode() if missing else b""
        return bytes(self._head + gap + tail).decode("utf-8", "replace")


@dataclass(frozen=True)
class Outcome:
    """How a command ended.

    Attributes:
        status: Exit status, or minus the signal's number, or None where we ended it.
        ended_by_us: ``time``, ``output`` or what ``excess`` said, the limit that it passed, or
            None.
    """

    status: int | None
    ended_by_us: str | None
    output: str
    duration_s: float


def run_bounded(
    command: Sequence[str],
    *,
    cwd: Path,
    environment: Mapping[str, str],
    wall_s: float,
    output: OutputLimits | None = None,
    on_line: Callable[[str], None] | None = None,
    excess: Callable[[int], str | None] = lambda _: None,
) -> Outcome:
    """Run a command and wait until it and everything that it started is gone.

    Args:
        excess: Called several times a second with the id of the process that everything
            descends from; names the limit that was passed, which ends the command.

    Raises:
        GraderFault: It could not be started or supervised.
    """
    limits = output or OutputLimits()
    kept = CappedOutput(limits)
    lines = _Lines(on_line)
    started = time.monotonic()
    with _supervised(command, cwd, environment) as (process, status_read):
        ended_by_us = _drain(process, kept, lines, limits, started + wall_s, excess)
        status = _finish(process, status_read)
    return Outcome(
        status=None if ended_by_us else status,
        ended_by_us=ended_by_us,
        output=kept.text(),
        duration_s=time.monotonic() - started,
    )


@contextlib.contextmanager
def _supervised(
    command: Sequence[str], cwd: Path, environment: Mapping[str, str]
) -> Iterator[tuple[subprocess.Popen[bytes], int]]:
    status_read, status_write = os.pipe()
    try:
        process = subprocess.Popen(
            [sys.executable, "-I", "-S", str(_SUPERVISOR), str(status_write), *command],
            cwd=cwd,
            env=dict(environment),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            pass_fds=(status_write,),
            start_new_session=True,
            bufsize=0,
        )
    except OSError as error:
        os.close(status_read)
        raise GraderFault(f"{command[0]} could not be started: {error}") from error
    finally:
        os.close(status_write)
    try:
        yield process, status_read
    finally:
        # Closing its input makes the supervisor kill everything, also on Ctrl-C here.
        _close(process.stdin)
        try:
            process.wait(_KILL_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        _close(process.stdout)
        os.close(status_read)


def _drain(
    process: subprocess.Popen[bytes],
    kept: CappedOutput,
    lines: _Lines,
    limits: OutputLimits,
    deadline: float,
    excess: Callable[[int], str | None],
) -> str | None:
    """Take the output until the supervisor has ended; the limit that was passed, or None."""
    assert process.stdout is not None
    seen = time.monotonic()
    next_look = seen + _POLL_S
    with selectors.DefaultSelector() as selector:
        selector.register(process.stdout, selectors.EVENT_READ)
        while True:
            now = time.monotonic()
            if now - seen > _FROZEN_S:
                # Ctrl-Z, or a container that was paused: nobody knows who could work meanwhile.
                deadline += now - seen
            seen = now
            left = deadline - now
            if left <= 0:
                return "time"
            if now >= next_look:
                passed = excess(process.pid)
                if passed is not None:
                    return passed
                # To look may take long where there is much to count; that is not a stop.
                seen = time.monotonic()
                next_look = seen + _POLL_S
            # Asked first: what was written until its end is there to be read afterwards.
            is_gone = process.poll() is not None
            if selector.select(0.0 if is_gone else min(left, _POLL_S)):
                block = os.read(process.stdout.fileno(), _CHUNK)
                if not block:
                    return None
                kept.feed(block)
                lines.feed(block)
                if kept.total > limits.total:
                    return "output"
            elif is_gone:
                # Somebody holds the pipe although the supervisor is gone.
                return None


def _finish(process: subprocess.Popen[bytes], status_read: int) -> int | None:
    """Wait for the supervisor; exit status or minus the signal, None where it was ended."""
    _close(process.stdin)
    try:
        process.wait(_KILL_S)
    except subprocess.TimeoutExpired as error:
        process.kill()
        raise GraderFault("processes of a command could not be killed") from error
    how, _, number = os.read(status_read, 100).decode().partition(" ")
    if how == "closed":
        return None
    if not number:
        raise GraderFault("the process that watches over a command was killed")
    return -int(number) if how == "signal" else int(number)


class _Lines:
    """Hands over complete lines."""

    def __init__(self, on_line: Callable[[str], None] | None) -> None:
        self._on_line = on_line
        self._rest = b""

    def feed(self, block: bytes) -> None:
        if self._on_line is None:
            return
        *complete, self._rest = (self._rest + block).split(b"\n")
        # An endless line must not be kept; who speaks last is heard.
        self._rest = self._rest[-_LONGEST_LINE:]
        for line in complete:
            self._on_line(line[-_LONGEST_LINE:].decode("utf-8", "replace"))


def _close(stream: IO[bytes] | None) -> None:
    if stream is not None:
        with contextlib.suppress(OSError):
            stream.close()
