"""The command ``rosgrade``: its commands, and how errors end it."""

from __future__ import annotations

import ast
import atexit
import gc
import signal
import sys
import traceback
from importlib import import_module
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from grader import __version__
from grader.cli import NOT_GRADED, USAGE
from grader.cli.screen.console import lasting_streams, print_error
from grader.errors import GraderFault, RosgradeError, machine_fault

_COLLECT_EACH = 50_000
"""New containers from which on Python looks for garbage; 700 by default."""
_COMMANDS = {
    "list": "list_command.list_command",
    "show": "show.show",
    "start": "start.start",
    "check": "check.check",
    "watch": "watch.watch",
    "batch": "batch.batch",
    "regrade": "regrade.regrade",
    "report": "report.report",
    "review": "review.review",
    "similar": "instructor.similar",
    "questions": "instructor.questions",
    "replay": "replay.replay",
    "selftest": "selftest.selftest",
    "new": "start.new",
    "validate": "catalogue.validate",
    "schema": "catalogue.schema",
    "checks": "catalogue.checks",
    "explain": "explain.explain",
    "sim": "sim.sim",
    "doctor": "doctor.doctor",
    "export": "export.other_systems",
    "underlay": "underlay.underlay",
}
"""Where each command is; a module with an ``app`` has commands of its own."""


class _Commands(TyperGroup):
    """All commands; only the module of the one that is called is imported."""

    def __init__(self, **settings: Any) -> None:
        """Know their names, in the order of the help."""
        super().__init__(**{**settings, "commands": dict.fromkeys(_COMMANDS)})

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """What the help and the completion of a shell tell of a command."""
        if cmd_name not in _COMMANDS:
            return None
        module, function = _COMMANDS[cmd_name].split(".")
        source = ast.parse(Path(__file__).with_name(f"{module}.py").read_bytes())
        functions = [node for node in source.body if isinstance(node, ast.FunctionDef)]
        docs = {node.name: ast.get_docstring(node) for node in functions}
        return TyperCommand(cmd_name, help=docs[function], rich_markup_mode=None)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command itself, with its options."""
        name, known, rest = super().resolve_command(ctx, args)
        return name, known and _load(str(known.name)), rest


def _load(name: str) -> Any:
    module, function = _COMMANDS[name].split(".")
    loaded = import_module(f"grader.cli.{module}")
    commands = getattr(loaded, "app", None)
    if commands is None:
        commands = typer.Typer(add_completion=False, rich_markup_mode=None)
        settings = {"allow_extra_args": name == "batch"}
        commands.command(name, context_settings=settings)(getattr(loaded, function))
    return typer.main.get_command(commands)


app = typer.Typer(
    name="rosgrade",
    cls=_Commands,
    help="Grade ROS 2 assignments: build the student's packages, run the real nodes, judge "
    "what was recorded.",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"rosgrade {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: bool = typer.Option(
        False, "--version", callback=_version, is_eager=True, help="Show the version and exit."
    ),
) -> None:
    """Options before the command."""


def main() -> None:
    """Entry point; a mistake of the user's ends with one message and no traceback."""
    # Imports make many objects and hardly any garbage: to look for some among them again and
    # again, and once more at the end, takes a tenth of a short command.
    gc.set_threshold(_COLLECT_EACH)
    atexit.register(gc.freeze)
    # A CI job that is canceled gets this, and leaves as little behind as one that gets Ctrl-C.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    # So does a closed terminal, but for what `nohup` was asked to keep.
    if signal.getsignal(signal.SIGHUP) is signal.SIG_DFL:
        signal.signal(signal.SIGHUP, signal.default_int_handler)
    # The end of a child must be reported even if the caller had blocked or ignored the signal.
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    try:
        with lasting_streams():
            app()
    except RosgradeError as error:
        print_error(str(error))
        sys.exit(NOT_GRADED if isinstance(error, GraderFault) else USAGE)
    except OSError as error:
        # A full disk, too few descriptors, a folder that was removed.
        print_error(str(machine_fault(error) or f"this machine: {error}"))
        sys.exit(NOT_GRADED)
    except Exception:
        # The exit code of a bug must not look as if points were lost.
        traceback.print_exc()
        sys.exit(NOT_GRADED)
