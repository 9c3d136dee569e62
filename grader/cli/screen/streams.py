"""Standard streams that cannot stop a grading: closed, full, or a pipe that nobody reads."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any, TextIO, TypeVar, cast

from grader.errors import GraderFault

_OUTPUT, _ERRORS = 1, 2
# Nobody wants to know the rest: `| head`, and a terminal that was closed.
_UNREAD = frozenset({errno.EPIPE, errno.EIO})

_Answer = TypeVar("_Answer")


class _Lasting:
    """A text stream that leads nowhere once it cannot be written to any more.

    It stands before Python's own stream, and not below it: what Ctrl-C interrupts there in the
    middle of a write would be written twice.

    Attributes:
        lost: Why, where what was written is missing somewhere; else None.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.lost: OSError | None = None

    def write(self, text: str) -> int:
        return self._lastingly(self._stream.write, text)

    def writelines(self, lines: Iterable[str]) -> None:
        for line in lines:
            self.write(line)

    def flush(self) -> None:
        self._lastingly(self._stream.flush)

    def _lastingly(self, call: Callable[..., _Answer], *arguments: str) -> _Answer:
        try:
            return call(*arguments)
        except OSError as error:
            if error.errno not in _UNREAD:
                self.lost = error
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self._stream.fileno())
            os.close(nowhere)
            return call(*arguments)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def lasting_streams() -> Iterator[None]:
    """Let the block go on, and end with its own status, whoever reads what it writes."""
    # Else a file or a pipe of ours would take the number, and be closed or written to by others.
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= _ERRORS:
        os.set_inheritable(descriptor, True)
    os.close(descriptor)
    # Somebody who shares a pipe or a terminal with us may have made it non-blocking.
    os.set_blocking(_OUTPUT, True)
    os.set_blocking(_ERRORS, True)
    output = _Lasting(sys.stdout or _opened(_OUTPUT))
    sys.stdout = cast("TextIO", output)
    sys.stderr = cast("TextIO", _Lasting(sys.stderr or _opened(_ERRORS)))
    try:
        yield
    finally:
        output.flush()
        if output.lost is not None:
            raise GraderFault(f"standard output cannot be written: {output.lost.strerror}")


def _opened(descriptor: int) -> TextIO:
    """A stream where Python has made none, because there was nothing to write to."""
    return open(descriptor, "w", encoding="utf-8", errors="backslashreplace", closefd=False)
