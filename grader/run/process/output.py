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
_LONGEST_LINE = 8192
# What a program writes with print(..., end=" ", flush=True) has no line end. Without a buffer
# print(a, b) writes in four pieces, between which a busy machine may hold it up; what courses
# print again and again comes every half second at most often.
_LONGEST_WAIT_NS = 400_000_000
_MOST_DECLARATIONS = 10_000
_LARGEST_NUMBER = 2**63
_OF_ENDPOINTS = ("publisher", "subscription")
_KINDS = frozenset(
    {
        *_OF_ENDPOINTS,
        *("started", "imported", "init", "node", "timer", "added", "spin", "published", "held"),
        *("made", "ran", "stands", "destroyed", "paused", "leaving", "exiting"),
    }
)
"""Kinds of declarations of a tracer; see ``tracer/sitecustomize.py``."""
_OF_PROCESS = frozenset({"started", "leaving"})
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
        self._partial = b""
        self.pid: int | None = None
        self._begun_ns = 0
        self._newest_ns = 0
        self._ended = False

    def feed(self, data: bytes, now_ns: int | None = None) -> None:
        """Split into lines; what has no line end is cut at a bound, and after 400 ms.

        A carriage return ends a line too: a progress bar writes many lines.
        """
        now_ns = time.time_ns() if now_ns is None else now_ns
        self.written_bytes += len(data)
        waited = bool(self._partial) and now_ns - self._begun_ns > _LONGEST_WAIT_NS
        if waited and self.name != "tracer":
            self.finish()
            self._ended = True
        if self._ended:
            data = data.removeprefix(b"\n")
        self._ended = data.endswith(b"\r")
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        if not self._partial or b"\n" in data:
            self._begun_ns = now_ns
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

    def _add(self, line: bytes, now_ns: int) -> None:
        over = max(0, len(line) - _LONGEST_LINE)
        text = line[:_LONGEST_LINE].decode(errors="replace")
        self.kept.dropped_bytes += over
        kept = LogLine(now_ns, self.process, self.name, text)
        self.kept.add(kept)
        if self._on_line is not None:
            self._on_line(kept)


class OutputReader:
    """Reads all pipes of all processes in one thread, which calls ``on_line`` with each line."""

    def __init__(self, limit_bytes: int, on_line: Callable[[LogLine], None] | None = None) -> None:
        self._limit = limit_bytes
        self._on_line = on_line
        self._selector = selectors.DefaultSelector()
        self._streams: list[_Stream] = []
        self._declarations: list[Declaration] = []
        self._foreign: set[str] = set()
        self._lock = threading.Lock()
        self._wake_read, self._wake_write = os.pipe()
        self._selector.register(self._wake_read, selectors.EVENT_READ, None)
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="output", daemon=True)
        self._thread.start()

    def add(self, fd: int, process: str, stream: str) -> None:
        """Read a pipe (stdout, stderr or tracer) until its end; it belongs to the reader now."""
        os.set_blocking(fd, False)
        on_line = self._on_line if stream != "tracer" else None
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
        return frozenset(self._foreign)

    def tail(self, process: str, stream: str, lines: int) -> list[str]:
        """The newest lines of a stream, for messages."""
        for item in list(self._streams):
            if item.process == process and item.name == stream:
                return [line.text for line in item.kept.lines[-lines:]]
        return []

    def close(self, limit_s: float) -> tuple[LogLine, ...]:
        """Wait for the ends of the pipes and return all lines in the order of their times."""
        self._closing = True
        os.write(self._wake_write, b".")
        self._thread.join(limit_s)
        for stream in self._streams:
            stream.finish()
        outputs = [stream for stream in self._streams if stream.name != "tracer"]
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
        if stream.name == "tracer":
            self._take_declarations(stream)

    def _take_declarations(self, stream: _Stream) -> None:
        """Turn lines of a tracer into declarations; note the process of any other line."""
        lines = stream.kept.lines
        stream.kept = KeptLines(self._limit)
        for line in lines:
            data = _parsed(line.text)
            if not data:
                if line.process not in self._foreign:
                    self._foreign.add(line.process)
                    self._declare(line, "foreign", {})
                continue
            # The first to start is the one that was launched.
            stream.pid = data["pid"] if stream.pid is None else stream.pid
            is_own = data["pid"] == stream.pid or data["kind"] not in _OF_PROCESS
            if is_own and _is_fit(data):
                self._declare(line, data.pop("kind"), data)

    def _declare(self, line: LogLine, kind: str, data: dict[str, Any]) -> None:
        if len(self._declarations) < _MOST_DECLARATIONS:
            self._declarations.append(Declaration(line.time_ns, line.process, kind, data))


def _parsed(text: str) -> dict[str, Any]:
    """The data in a line of a tracer; empty if a tracer cannot have written it."""
    try:
        data = json.loads(text, parse_constant=lambda _: None)
        is_known = data["kind"] in _KINDS and isinstance(data["pid"], int)
        is_whole = data["kind"] not in _OF_ENDPOINTS or type(data["depth"]) is int
    except (ValueError, RecursionError, TypeError, KeyError):
        return {}
    return data if is_known and is_whole else {}


def _is_fit(data: dict[str, Any]) -> bool:
    """Whether it can be recorded: the student, too, can write to the pipe, large and deep."""
    inner = [value for value in data.values() if isinstance(value, dict)]
    values = [value for item in (data, *inner) for value in item.values() if value not in inner]
    keys = [key for item in (data, *inner) for key in item]
    return all(map(_is_plain, (*values, *keys)))


def _is_plain(value: Any) -> bool:
    if isinstance(value, str):
        return not any("\ud800" <= char <= "\udfff" for char in value)
    if isinstance(value, int | float):
        return abs(value) < _LARGEST_NUMBER
    return value is None
