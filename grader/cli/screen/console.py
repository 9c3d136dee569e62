"""Where the commands write: results on standard output, errors on the other, pages in a browser."""

from __future__ import annotations

import os
import sys
import threading
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console


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
    shown = any(os.environ.get(name) for name in ("BROWSER", "DISPLAY", "WAYLAND_DISPLAY"))
    failed = [sys.platform.startswith("linux") and not shown]
    if not failed[0]:
        # Some browsers keep the program that starts them until they are closed: wait 2 s at most.
        work = threading.Thread(target=lambda: failed.append(not webbrowser.open(url)), daemon=True)
        work.start()
        work.join(2.0)
    if any(failed):
        print_warning(f"--open: no browser could be started; the page is {shown_url or url}")
