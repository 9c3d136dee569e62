"""Standard streams that cannot stop a grading: closed, full, or a pipe that nobody reads."""

from __future__ import annotations

import errno
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TextIO

from grader.errors import GraderFault

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

_OUTPUT, _ERRORS = 1, 2
# Nobody wants to know the rest: `| head`, and a terminal that was closed.
_UNREAD = frozenset({errno.EPIPE, errno.EIO})


class _Lasting(io.FileIO):
    """A descriptor that leads nowhere once it cannot be written to any more.

    Attributes:
        lost: Why, where what was written is missing somewhere; else None.
    """

    lost: OSError | None = None

    def write(self, data: ReadableBuffer, /) -> int | None:  # type: ignore[override]
        try:
            return super().write(data)
        except OSError as error:
            if error.errno not in _UNREAD:
                self.lost = error
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.fileno())
            os.close(nowhere)
            return super().write(data)


@contextmanager
def lasting_streams() -> Iterator[None]:
    """Let the block go on, and end with its own status, whoever reads what it writes.

    Raises:
        GraderFault: Something is missing of what was written to standard output.
    """
    # Else a file or a pipe of ours would take the number, and be closed or written to by others.
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= _ERRORS:
        os.set_inheritable(descriptor, True)
    os.close(descriptor)
    output = _Lasting(_OUTPUT, "w", closefd=False)
    sys.stdout = _text(output, sys.stdout)
    sys.stderr = _text(_Lasting(_ERRORS, "w", closefd=False), sys.stderr)
    sys.stderr.reconfigure(line_buffering=True)
    try:
        yield
    finally:
        sys.stdout.flush()
        if output.lost is not None:
            raise GraderFault(f"standard output cannot be written: {output.lost.strerror}")


def _text(raw: io.FileIO, like: TextIO | None) -> io.TextIOWrapper:
    """A stream with the encoding and the buffering of one that Python has made, if it has."""
    if not isinstance(like, io.TextIOWrapper):
        return io.TextIOWrapper(io.BufferedWriter(raw), "utf-8", "backslashreplace")
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        like.encoding,
        like.errors,
        line_buffering=like.line_buffering,
        write_through=like.write_through,
    )
