"""Standard streams that cannot stop a grading: full, or a pipe that is not read to its end."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any, TextIO, TypeVar, cast

from grader.errors import GraderFault

# The rest is not wanted: `| head`, and a terminal that was closed.
_UNREAD = frozenset({errno.EPIPE, errno.EIO})

_Answer = TypeVar("_Answer")


class _Lasting:
    """A text stream that drops what it gets once writing has failed.

    It wraps Python's own stream and is not below it: a write that Ctrl-C interrupts there would
    be written twice.
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
    """Let the block go on and end with its own status, also when its output is no longer read."""
    output = _Lasting(sys.stdout)
    sys.stdout = cast("TextIO", output)
    sys.stderr = cast("TextIO", _Lasting(sys.stderr))
    try:
        yield
    finally:
        output.flush()
        if output.lost is not None:
            raise GraderFault(f"standard output cannot be written: {output.lost.strerror}")
