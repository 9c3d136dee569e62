"""Output of the student's processes: always drained, kept within bounds, line by line."""

from __future__ import annotations

import json
import os
import selectors
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from grader.recording.model import Declaration, LogLine

_READ_BYTES = 1 << 16
"""What a pipe of Linux holds."""
_LONGEST_LINE = 8192
# What a program writes with print(..., end=" ", flush=True) has no line end. Without a buffer
# print(a, b) writes in four pieces, between which a busy machine may hold it up; what courses
# print again and again comes every half second at most often.
_LONGEST_WAIT_NS = 400_000_000
_MOST_DECLARATIONS = 10_000
_LARGEST_NUMBER = 2**63
"""A recording holds numbers in 64 bits."""
_TRACER = "tracer"
"""Name of the stream on which a tracer reports, besides stdout and stderr."""
_KINDS_WITH_DEPTH = ("publisher", "subscription")
_KINDS = frozenset(
    {
        *_KINDS_WITH_DEPTH,
        *("started", "imported", "init", "node", "timer", "added", "spin", "published", "held"),
        *("made", "ran", "stands", "destroyed", "paused", "leaving", "exiting"),
    }
)
"""Kinds of declarations of a tracer; see ``tracer/sitecustomize.py``."""
_KINDS_OF_LAUNCHED_PROCESS = frozenset({"started", "leaving"})
"""Kinds that count only for the process that was launched, not for those that it starts."""


@dataclass
class KeptLines:
    """The first and the last lines of one stream, half of ``limit`` bytes each."""

    limit: int
    head: list[LogLine] = field(default_factory=list)
    tail: deque[LogLine] = field(default_factory=deque)
    head_bytes: int = 0
    tail_bytes: int = 0
    dropped_bytes: int = 0

    @property
    def lines(self) -> list[LogLine]:
        """What is kept, in the order of its arrival."""
        return [*self.head, *self.tail]

    def add(self, line: LogLine) -> None:
        """Keep a line, perhaps instead of an older one."""
        size = len(line.text) + 1
        if not self.tail and self.head_bytes + size <= self.limit // 2:
            self.head.append(line)
            self.head_bytes += size
            return
        self.tail.append(line)
        self.tail_bytes += size
        while self.tail_bytes > self.limit // 2 and len(self.tail) > 1:
            dropped = len(self.tail.popleft().text) + 1
            self.tail_bytes -= dropped
            self.dropped_bytes += dropped


class _Stream:
    """One pipe of a process, cut into lines."""

    def __init__(
        self,
        process: str,
        name: str,
        limit: int,
        on_line: Callable[[LogLine], None] | None = None,
    ) -> None:
        self.process = process
        self.name = name
        self._on_line = on_line
        self.kept = KeptLines(limit)
        self.written_bytes = 0
        self.launched_pid: int | None = None
        self._partial = b""
        """What was written since the last line end."""
        self._partial_began_ns = 0
        self._newest_ns = 0
        self._skips_line_feed = False
        """Whether a line was ended already without the line feed that may come next."""

    def feed(self, data: bytes, now_ns: int | None = None) -> None:
        """Split into lines; what has no line end is cut at a bound, and after 400 ms.

        A carriage return ends a line too: a progress bar writes many lines.
        """
        now_ns = time.time_ns() if now_ns is None else now_ns
        self.written_bytes += len(data)
        has_waited = self._partial and now_ns - self._partial_began_ns > _LONGEST_WAIT_NS
        if has_waited and self.name != _TRACER:
            self.finish()
            self._skips_line_feed = True
        if self._skips_line_feed:
            data = data.removeprefix(b"\n")
        # Of \r\n the second half may come with the next piece.
        self._skips_line_feed = data.endswith(b"\r")
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        if not self._partial or b"\n" in data:
            self._partial_began_ns = now_ns
        self._newest_ns = now_ns
        *lines, self._partial = (self._partial + data).split(b"\n")
        for line in lines:
            self._add(line, now_ns)
        if len(self._partial) > _LONGEST_LINE:
            self._add(self._partial, now_ns)
            self._partial = b""

    def finish(self) -> None:
        """Keep a last line that has no line end."""
        if self._partial:
            self._add(self._partial, self._newest_ns)
            self._partial = b""

    def _add(self, data: bytes, now_ns: int) -> None:
        self.kept.dropped_bytes += max(0, len(data) - _LONGEST_LINE)
        text = data[:_LONGEST_LINE].decode(errors="replace")
        line = LogLine(now_ns, self.process, self.name, text)
        self.kept.add(line)
        if self._on_line is not None:
            self._on_line(line)


class OutputReader:
    """Reads all pipes of all processes in one thread, which calls ``on_line`` with each line."""

    def __init__(self, limit_bytes: int, on_line: Callable[[LogLine], None] | None = None) -> None:
        self._limit = limit_bytes
        self._on_line = on_line
        self._selector = selectors.DefaultSelector()
        self._streams: list[_Stream] = []
        self._declarations: list[Declaration] = []
        self._forgers: set[str] = set()
        self._lock = threading.Lock()
        self._wake_read, self._wake_write = os.pipe()
        self._selector.register(self._wake_read, selectors.EVENT_READ, None)
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="output", daemon=True)
        self._thread.start()

    def add(self, fd: int, process: str, stream: str) -> None:
        """Read a pipe (stdout, stderr or tracer) until its end; it belongs to the reader now."""
        os.set_blocking(fd, False)
        on_line = self._on_line if stream != _TRACER else None
        target = _Stream(process, stream, self._limit, on_line)
        with self._lock:
            self._streams.append(target)
            self._selector.register(fd, selectors.EVENT_READ, target)
        os.write(self._wake_write, b".")

    @property
    def declarations(self) -> tuple[Declaration, ...]:
        """What the tracers have reported so far."""
        return tuple(self._declarations)

    @property
    def forgers(self) -> frozenset[str]:
        """Processes in which other code than the tracer wrote to the tracer's pipe."""
        return frozenset(self._forgers)

    def tail(self, process: str, stream: str, lines: int) -> list[str]:
        """The newest lines of a stream, for messages."""
        for known in list(self._streams):
            if known.process == process and known.name == stream:
                return [line.text for line in known.kept.lines[-lines:]]
        return []

    def close(self, limit_s: float) -> tuple[LogLine, ...]:
        """Wait for the ends of the pipes and return all lines in the order of their times."""
        self._closing = True
        os.write(self._wake_write, b".")
        self._thread.join(limit_s)
        for stream in self._streams:
            stream.finish()
        outputs = [stream for stream in self._streams if stream.name != _TRACER]
        lines = [line for stream in outputs for line in stream.kept.lines]
        return tuple(sorted(lines, key=lambda line: line.time_ns))

    @property
    def written_bytes(self) -> int:
        """How much all processes wrote so far, kept or not."""
        return sum(stream.written_bytes for stream in list(self._streams))

    def dropped_bytes(self, process: str) -> int:
        """How much output of a process was not kept."""
        return sum(s.kept.dropped_bytes for s in self._streams if s.process == process)

    def _run(self) -> None:
        # The pipe that wakes this thread is the last that is left.
        while not (self._closing and len(self._selector.get_map()) == 1):
            for key, _ in self._selector.select():
                if key.data is None:
                    os.read(self._wake_read, _READ_BYTES)
                    continue
                self._read(key.fd, key.data)

    def _read(self, fd: int, stream: _Stream) -> None:
        try:
            data = os.read(fd, _READ_BYTES)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._selector.unregister(fd)
            os.close(fd)
            return
        stream.feed(data)
        if stream.name == _TRACER:
            self._take_declarations(stream)

    def _take_declarations(self, stream: _Stream) -> None:
        """Turn lines of a tracer into declarations; note the process of any other line."""
        lines = stream.kept.lines
        stream.kept = KeptLines(self._limit)
        for line in lines:
            data = _parsed(line.text)
            if data is None:
                if line.process not in self._forgers:
                    self._forgers.add(line.process)
                    self._declare(line, "foreign", {})
                continue
            if stream.launched_pid is None:
                # The first to report is the process that was launched.
                stream.launched_pid = data["pid"]
            is_launched = data["pid"] == stream.launched_pid
            counts = is_launched or data["kind"] not in _KINDS_OF_LAUNCHED_PROCESS
            if counts and _can_be_recorded(data):
                self._declare(line, data.pop("kind"), data)

    def _declare(self, line: LogLine, kind: str, data: dict[str, Any]) -> None:
        if len(self._declarations) < _MOST_DECLARATIONS:
            self._declarations.append(Declaration(line.time_ns, line.process, kind, data))


def _parsed(text: str) -> dict[str, Any] | None:
    """The data in a line of a tracer; None if a tracer cannot have written it."""
    try:
        data: dict[str, Any] = json.loads(text, parse_constant=lambda _: None)
        is_known = data["kind"] in _KINDS and isinstance(data["pid"], int)
        is_whole = data["kind"] not in _KINDS_WITH_DEPTH or type(data["depth"]) is int
    except (ValueError, RecursionError, TypeError, KeyError):
        return None
    return data if is_known and is_whole else None


def _can_be_recorded(data: dict[str, Any]) -> bool:
    """Whether it is flat, or one level deep: the student, too, can write to the pipe."""
    for value in data.values():
        if isinstance(value, dict):
            if not all(map(_is_plain, (*value.keys(), *value.values()))):
                return False
        elif not _is_plain(value):
            return False
    return all(map(_is_plain, data))


def _is_plain(value: Any) -> bool:
    """Whether it is nothing, a number of 64 bits, or a text without lone surrogates."""
    if isinstance(value, str):
        return not any("\ud800" <= char <= "\udfff" for char in value)
    if isinstance(value, int | float):
        return abs(value) < _LARGEST_NUMBER
    return value is None
