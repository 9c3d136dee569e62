"""Opening a page in the browser of whoever sits at this machine."""

from __future__ import annotations

import os
import sys
import threading
import webbrowser

from grader.cli.screen.console import print_warning

_SETTLED_S = 2.0
"""A browser that has not failed by then is one that stays."""


def open_page(url: str) -> None:
    """Open a page, or say that it has to be opened by hand."""
    if not _is_there():
        print_warning(f"--open: there is no browser on this machine; the page is {url}")
        return
    failed: list[bool] = []
    # Some browsers keep who starts them until they are closed.
    opening = threading.Thread(target=lambda: failed.append(not webbrowser.open(url)), daemon=True)
    opening.start()
    opening.join(_SETTLED_S)
    if any(failed):
        print_warning(f"--open: the browser could not be started; the page is {url}")


def _is_there() -> bool:
    # Without a display only browsers for terminals are found, and they would take ours.
    shown = any(os.environ.get(name) for name in ("BROWSER", "DISPLAY", "WAYLAND_DISPLAY"))
    if sys.platform.startswith("linux") and not shown:
        return False
    try:
        webbrowser.get()
    except webbrowser.Error:
        return False
    return True
