"""Where the commands write: results on standard output, progress and errors on the other."""

from __future__ import annotations

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
