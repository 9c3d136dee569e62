"""``rosgrade underlay``: packages that this ROS installation lacks, built once and kept."""

from __future__ import annotations

import time
from collections import Counter
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from grader.assignment.load import load_assignment
from grader.cli.options import Quiet, SandboxChoice, chosen_sandbox
from grader.cli.screen.console import output_console, say
from grader.cli.screen.progress import Progress
from grader.errors import UsageError
from grader.grading.type_support import wanted_underlays
from grader.machine import ros
from grader.machine.resources import cache_folder
from grader.sandbox.choice import Choice
from grader.spec.nearest_name import nearest_or_all
from grader.submission.underlay.definition import find_underlay, named_sets
from grader.submission.underlay.ros2_command import write_command
from grader.submission.underlay.store import UnderlayStore

app = typer.Typer(no_args_is_help=True, add_completion=False, rich_markup_mode=None)


@app.callback()
def underlay() -> None:
    """Add what the ROS installation lacks: the command `ros2`, launch files, tf2, rclcpp."""


@app.command()
def add(
    what: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="NAME|FILE.repos|FOLDER",
            help="A named set (see `rosgrade underlay list`), a .repos file, a folder of packages.",
        ),
    ] = None,
    assignment: Annotated[
        str | None,
        typer.Option("--for", metavar="ASSIGNMENT", help="All that its submissions may need."),
    ] = None,
    submission: Annotated[
        Path | None,
        typer.Option(help="With --for: only what this submission needs."),
    ] = None,
    wait: Annotated[
        float,
        typer.Option(metavar="SECONDS", help="Longest time until a git server answers.", min=1),
    ] = 30.0,
    sandbox: SandboxChoice = Choice.AUTO,
    quiet: Quiet = False,
) -> None:
    """Fetch packages and build them, once for this machine and ROS installation.

    Every submission of an assignment that names them in `underlays` can use them. A package that
    ROS already has is not built. After an interruption, the command continues where it stopped.
    """
    found = [find_underlay(given) for given in what or ()]
    if assignment is not None:
        found += wanted_underlays(load_assignment(assignment), submission)
    elif not found:
        raise UsageError("name what to add, such as `rosgrade underlay add rclcpp`, or --for ID")
    progress, installation, began_s = Progress(quiet), ros.find(), time.monotonic()
    with progress.shown():
        place = chosen_sandbox(sandbox, progress)
        store = UnderlayStore(cache_folder(), installation, progress.say, place)
        built = [name for underlay in found for name in store.add(underlay, wait)]
    if built:
        say(f"Built in {time.monotonic() - began_s:.0f} s: {', '.join(built)}")
    command = write_command(installation, store)
    if command:
        say(f"The command ros2: {command}")


@app.command("list")
def list_command() -> None:
    """List the named sets, and what is built for this ROS installation."""
    store = UnderlayStore(cache_folder(), ros.find())
    kept = [one for one, _ in store.installed()]
    names = Counter(one.name for one in kept)
    # Those of one name are told apart by where they are defined.
    built = {
        one.places[0] if names[one.name] > 1 and one.places else one.name: " ".join(one.packages)
        for one in kept
    }
    table = Table("UNDERLAY", "HERE", "PACKAGES", box=None, pad_edge=False)
    for name in named_sets():
        underlay = find_underlay(name)
        state = "no" if store.missing([underlay]) else "built" if name in built else "in ROS"
        packages = built.pop(name, "") if state == "built" else ""
        table.add_row(name, state, packages or " ".join(sorted(underlay.listed)))
    for name, packages in built.items():
        table.add_row(name, "built", packages)
    output_console().print(table)


@app.command()
def remove(
    names: Annotated[list[str], typer.Argument(metavar="NAME", help="As `list` shows it.")],
) -> None:
    """Remove underlays from this machine; their sources stay."""
    installation = ros.find()
    store = UnderlayStore(cache_folder(), installation)
    for name in names:
        if not store.remove(name):
            known = [one.name for one, _ in store.installed()]
            raise UsageError(f"no underlay {name!r} is built here.{nearest_or_all(name, known)}")
        say(f"Removed: {name}")
    write_command(installation, store)
