"""The command ``rosgrade``: its commands, and how errors end it."""

from __future__ import annotations

import atexit
import gc
import signal
import sys
import traceback

import typer

from grader import __version__
from grader.cli import (
    NOT_GRADED,
    USAGE,
    assignments,
    batch,
    catalogue,
    check,
    doctor,
    export,
    instructor,
    regrade,
    replay,
    report,
    review,
    selftest,
    sim,
    start,
    underlay,
    watch,
)
from grader.cli.screen.console import lasting_streams, print_error
from grader.errors import GraderFault, RosgradeError, machine_fault

_COLLECT_EACH = 50_000
"""New containers from which on Python looks for garbage; 700 by default."""

app = typer.Typer(
    name="rosgrade",
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


app.command("list")(assignments.list_command)
app.command("show")(assignments.show)
app.command("start")(start.start)
app.command("check")(check.check)
app.command("watch")(watch.watch)
app.command("batch", context_settings={"allow_extra_args": True})(batch.batch)
app.command("regrade")(regrade.regrade)
app.command("report")(report.report)
app.command("review")(review.review)
app.command("similar")(instructor.similar)
app.command("questions")(instructor.questions)
app.command("replay")(replay.replay)
app.add_typer(export.app, name="export")
app.command("selftest")(selftest.selftest)
app.command("new")(start.new)
app.command("validate")(catalogue.validate)
app.command("schema")(catalogue.schema)
app.command("checks")(catalogue.checks)
app.command("explain")(catalogue.explain)
app.command("sim")(sim.sim)
app.add_typer(underlay.app, name="underlay")
app.command("doctor")(doctor.doctor)


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
