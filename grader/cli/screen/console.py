"""Where the commands write: results on standard output, progress and errors on the other."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console


def output_console() -> Console:
    """Console on standard output."""
    from rich.console import Console

    return Console(highlight=False, emoji=False, markup=False)


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


class Progress:
    """What happens at the moment: a line that is overwritten on a terminal, else plain lines."""

    def __init__(self, quiet: bool = False) -> None:
        """Prepare."""
        self._quiet = quiet
        self._status: object | None = None
        self._last = ""

    @contextmanager
    def shown(self) -> Iterator[Progress]:
        """Show the line while the block runs."""
        if self._quiet or not sys.stderr.isatty():
            yield self
            return
        from rich.console import Console

        with Console(stderr=True, highlight=False, emoji=False).status("") as status:
            self._status = status
            try:
                yield self
            finally:
                self._status = None

    def say(self, text: str) -> None:
        """Say in a few words what happens now."""
        if self._quiet or text == self._last:
            return
        self._last = text
        if self._status is not None:
            from rich.text import Text

            self._status.update(Text(text))  # type: ignore[attr-defined]
        else:
            print(f"rosgrade: {text}", file=sys.stderr, flush=True)
