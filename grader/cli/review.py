"""``rosgrade review``: read a class in a browser, comment it, and give points."""

from __future__ import annotations

import subprocess
import threading
from contextlib import suppress
from getpass import getuser
from typing import Annotated

import typer

from grader.cli.options import ClassFolder, Port
from grader.cli.screen.console import open_page, say
from grader.server.review import ReviewServer


def review(
    out: ClassFolder,
    port: Port = 0,
    open_browser: Annotated[bool, typer.Option("--open", help="Open it in a browser.")] = False,
    by: Annotated[
        str | None,
        typer.Option(metavar="INITIALS", help="Who reviews; by default from git's user.name."),
    ] = None,
) -> None:
    """Review a class in a browser, until Ctrl-C.

    Shows reports with the source beside them, comments, points by a person, and failures with the
    same cause. It saves what you write in OUT/review/. Only this machine can open the page.
    """
    initials = by or _initials()
    server = ReviewServer(out, initials, port)
    say(f"Review of {out} by {initials}: {server.url}")
    say("Ctrl-C ends")
    if open_browser:
        open_page(server.door(out), server.url)
    try:
        threading.Event().wait()
    except KeyboardInterrupt:
        say("\nWriting the reports that were changed.")
        server.close()
        say("No longer serving.")


def _initials() -> str:
    """Initials of the name that git knows, or the user's name."""
    name = ""
    with suppress(OSError):
        command = ["git", "config", "user.name"]
        name = subprocess.run(command, capture_output=True, text=True, check=False).stdout
    return "".join(word[0] for word in name.split()) or getuser()
