"""``rosgrade underlay``: packages that this ROS installation lacks, built once and kept."""

from __future__ import annotations

from typing import Annotated

import typer

from grader.cli.options import Quiet, SandboxChoice, chosen_sandbox
from grader.cli.screen.console import output_console, say
from grader.cli.screen.progress import Progress
from grader.findings.wording import counted
from grader.resources import cache_folder
from grader.sandbox.choice import Choice

app = typer.Typer(
    no_args_is_help=True,
    help="Add what the ROS installation lacks: the command `ros2`, launch files, tf2, rclcpp.",
)


@app.command()
def add(
    what: Annotated[
        list[str],
        typer.Argument(
            metavar="NAME|FILE.repos|FOLDER",
            help="A named set (see `rosgrade underlay list`), a .repos file, a folder of packages.",
        ),
    ],
    wait: Annotated[
        float,
        typer.Option(metavar="SECONDS", help="Longest time until a git server answers.", min=1),
    ] = 30.0,
    sandbox: SandboxChoice = Choice.AUTO,
    quiet: Quiet = False,
) -> None:
    """Fetch packages and build them, once for this machine and ROS installation.

    They lie under every submission of an assignment that names them in `underlays`. A package
    that ROS has already is not built. An interrupted command goes on where it stopped.
    """
    from grader import ros
    from grader.ros2_command import write_command
    from grader.submission.underlay.definition import find_underlay
    from grader.submission.underlay.store import UnderlayStore

    found = [find_underlay(given) for given in what]
    progress = Progress(quiet)
    installation = ros.find()
    with progress.shown():
        place = chosen_sandbox(sandbox, progress)
        store = UnderlayStore(cache_folder(), installation, progress.say, place)
        for underlay in found:
            for built in store.add(underlay, wait):
                say(
                    f"{built.name}: {counted(len(built.packages), 'package')} built "
                    f"in {built.duration_s:.0f} s"
                )
    command = write_command(installation, store)
    if command:
        say(f"The command ros2: {command}")


@app.command("list")
def list_command() -> None:
    """List the named sets, and what is built for this ROS installation."""
    from rich.table import Table

    from grader import ros
    from grader.submission.underlay.definition import find_underlay, named_sets
    from grader.submission.underlay.store import UnderlayStore

    store = UnderlayStore(cache_folder(), ros.find())
    built = dict((one.name, one) for one, _ in store.installed())
    table = Table("UNDERLAY", "HERE", "PACKAGES", box=None, pad_edge=False)
    for name in (*named_sets(), *(name for name in built if name not in named_sets())):
        state, packages = "no", list[str]()
        if name in named_sets():
            underlay = find_underlay(name)
            packages = sorted(underlay.listed)
            state = "no" if store.missing([underlay]) else "in ROS"
        if name not in named_sets() or (name in built and state != "no"):
            state, packages = f"built {built[name].built[:10]}", list(built[name].packages)
        table.add_row(name, state, " ".join(packages))
    output_console().print(table)


@app.command()
def remove(
    names: Annotated[list[str], typer.Argument(metavar="NAME", help="As `list` shows it.")],
) -> None:
    """Remove underlays from this machine; their sources stay."""
    from grader import ros
    from grader.errors import UsageError
    from grader.ros2_command import write_command
    from grader.spec.nearest_name import nearest_or_all
    from grader.submission.underlay.store import UnderlayStore

    installation = ros.find()
    store = UnderlayStore(cache_folder(), installation)
    for name in names:
        if not store.remove(name):
            known = [one.name for one, _ in store.installed()]
            raise UsageError(f"no underlay {name!r} is built here.{nearest_or_all(name, known)}")
        say(f"Removed: {name}")
    write_command(installation, store)
