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
from grader.submission.underlay import transfer
from grader.submission.underlay.definition import SETS, find_underlay, packages_of_ros
from grader.submission.underlay.portable import sha256_of
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
            metavar="PACKAGE|FILE.repos|FOLDER",
            help="A package of ROS 2 Jazzy or a set of them (see `rosgrade underlay list`), a "
            ".repos file, a folder of packages.",
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

    With each package of ROS 2 comes what it needs. What ROS already has is not built. Submissions
    that need such a package get it; .repos files and folders only where the assignment names them
    in `underlays`. After an interruption, the command continues where it stopped.
    """
    underlays = [find_underlay(name) for name in what or ()]
    if assignment is not None:
        underlays += wanted_underlays(load_assignment(assignment), submission)
    elif not underlays:
        raise UsageError("name what to add, such as `rosgrade underlay add rclcpp`, or --for ID")
    progress, installation, began_s = Progress(quiet), ros.find(), time.monotonic()
    with progress.shown():
        place = chosen_sandbox(sandbox, progress)
        store = UnderlayStore(cache_folder(), installation, progress.say, place)
        built = store.add(underlays, wait)
    if built:
        say(f"Built in {time.monotonic() - began_s:.0f} s: {', '.join(built)}")
    command = write_command(installation, store)
    if command:
        say(f"The command ros2: {command}")


@app.command("list")
def list_command() -> None:
    """List the packages that courses need most, and what is built for this ROS installation."""
    installation = ros.find()
    store = UnderlayStore(cache_folder(), installation)
    table = Table("UNDERLAY", "HERE", "PACKAGES", box=None, pad_edge=False)
    for name, packages in SETS.items():
        if store.missing([packages_of_ros(name)]):
            state = "no"
        else:
            state = "in ROS" if installation.packages.issuperset(packages) else "built"
        table.add_row(name, state, " ".join(packages))
    of_sets = {name for packages in SETS.values() for name in packages}
    others = [underlay for underlay, _ in store.installed() if underlay.name not in of_sets]
    counts = Counter(underlay.name for underlay in others)
    for underlay in others:
        # Those of one name are told apart by where they are defined.
        is_unique = counts[underlay.name] == 1 or not underlay.places
        name = underlay.name if is_unique else underlay.places[0]
        table.add_row(name, "built", underlay.version or " ".join(underlay.packages))
    output_console().print(table)


@app.command()
def remove(
    names: Annotated[list[str], typer.Argument(metavar="NAME", help="As `list` shows it.")],
) -> None:
    """Remove underlays from this machine; their sources stay."""
    installation = ros.find()
    store = UnderlayStore(cache_folder(), installation)
    for name in names:
        if not store.kept.remove(name):
            known = {place for one, _ in store.installed() for place in one.asked_by}
            raise UsageError(f"no underlay {name!r} is built here.{nearest_or_all(name, known)}")
        say(f"Removed: {name}")
    write_command(installation, store)


@app.command("export")
def export_command(
    file: Annotated[Path, typer.Argument(help="Archive to write: a .tar.gz.")],
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="[PACKAGE]...", help="Packages or sets; by default all."),
    ] = None,
) -> None:
    """Write the packages of ROS 2 that are built here to a file, for machines of the same kind.

    Whoever imports the file does not have to build them. Lists and folders of a course are not in
    it.
    """
    store = UnderlayStore(cache_folder(), ros.find())
    wanted = [package for name in names or () for package in packages_of_ros(name).packages]
    written = transfer.export(store.packages, wanted, file)
    say(f"{file}: {', '.join(written)}")
    say(f"To name where it lies: https://ADDRESS/{file.name}#sha256={sha256_of(file)}")


@app.command("import")
def import_command(
    place: Annotated[
        str,
        typer.Argument(
            metavar="FILE|URL",
            help="What `rosgrade underlay export` wrote, or https://ADDRESS#sha256=HASH.",
        ),
    ],
) -> None:
    """Take packages that were built on another machine of the same kind.

    The same kind is: processor, release of the system, version of Python and of ROS. Only import
    files of people whom you trust, as the file holds programs.
    """
    installation = ros.find()
    store = UnderlayStore(cache_folder(), installation)
    brought = transfer.bring(store.packages, place)
    say(f"Imported: {', '.join(brought)}" if brought else "All of it is there already")
    command = write_command(installation, store)
    if command:
        say(f"The command ros2: {command}")
