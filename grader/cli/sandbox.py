"""The option ``--sandbox`` of the commands that run submissions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from grader.cli.screen.progress import Progress
from grader.resources import cache_folder
from grader.sandbox.choice import Choice

__all__ = ["Choice", "SandboxChoice", "chosen_sandbox"]

if TYPE_CHECKING:
    from grader.sandbox.sandbox import Sandbox

SandboxChoice = Annotated[
    Choice,
    typer.Option(
        "--sandbox",
        help="Sandbox to build and run the submission in: auto (if bubblewrap works), bwrap "
        "(an error if it does not work), none.",
    ),
]


def chosen_sandbox(choice: Choice, progress: Progress) -> Sandbox | None:
    """The sandbox that was asked for; says which one it is, or that there is none."""
    from grader.sandbox.trial import choose

    sandbox, notice = choose(choice, cache_folder())
    progress.say(notice or f"sandbox: {sandbox.description if sandbox else 'none'}")
    return sandbox
