"""Where the commands write: results on standard output, errors on the other, pages in a browser."""

from __future__ import annotations

import errno
import os
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TextIO, TypeVar, cast

from grader.errors import GraderFault

if TYPE_CHECKING:
    from rich.console import Console

# The rest is not wanted: `| head`, and a terminal that was closed.
_UNREAD = frozenset({errno.EPIPE, errno.EIO})

_BROWSER_S = 2.0
"""A browser that cannot be started is known by then."""
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


def output_console() -> Console:
    """Console on standard output."""
    from rich.console import Console

    return Console(highlight=False, emoji=False, markup=False)


def say(text: str) -> None:
    """One message on standard output, on as many lines as it needs."""
    output_console().print(text, soft_wrap=True)


def print_error(message: str) -> None:
    """One message on standard error."""
    _print("rosgrade: error: ", "bold red", message)


def print_warning(message: str) -> None:
    """One message on standard error that stops nothing."""
    _print("rosgrade: warning: ", "bold yellow", message)


def _print(label: str, style: str, message: str) -> None:
    from rich.console import Console
    from rich.text import Text

    console = Console(stderr=True, highlight=False, emoji=False, soft_wrap=True)
    console.print(Text.assemble((label, style), message))


def open_page(url: str, shown_url: str = "") -> None:
    """Open a page in the user's browser, or say that it has to be opened by hand.

    Args:
        shown_url: What is said instead of ``url``, if a person opens another address.
    """
    import webbrowser

    # Without a display only browsers for terminals are found, which would take this terminal.
    has_display = any(os.environ.get(name) for name in ("BROWSER", "DISPLAY", "WAYLAND_DISPLAY"))
    can_open = has_display or not sys.platform.startswith("linux")
    opened: list[bool] = []
    if can_open:
        # Some browsers keep the program that starts them until they are closed.
        work = threading.Thread(target=lambda: opened.append(webbrowser.open(url)), daemon=True)
        work.start()
        work.join(_BROWSER_S)
    if not can_open or opened == [False]:
        print_warning(f"--open: no browser could be started; the page is {shown_url or url}")
