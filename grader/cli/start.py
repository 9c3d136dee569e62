"""``rosgrade start`` and ``rosgrade new``: a package or an assignment to begin with."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from grader.assignment.selection import with_values
from grader.authoring.scaffold import write_assignment
from grader.authoring.starter import write_starter
from grader.cli.options import AssignmentName, SetValues, load_with_values
from grader.cli.screen.console import print_warning, say
from grader.errors import GraderFault
from grader.grading.prerequisites import remedy_for_cpp
from grader.machine import ros


def start(
    assignment: AssignmentName,
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="DIR", help="Folder for the package, such as the src of your workspace."
        ),
    ] = Path(),
    set_values: SetValues = None,
    cpp: Annotated[bool, typer.Option("--cpp", help="A package in C++ (ament_cmake).")] = False,
) -> None:
    """Create a package to start from: it builds and runs.

    You write what it does. Existing files are never overwritten.
    """
    if cpp:
        try:
            remedy = remedy_for_cpp(ros.find())
        except GraderFault as fault:
            remedy = str(fault)
        if remedy:
            print_warning(f"before C++ can be built here: {remedy}")
    loaded = load_with_values(assignment, set_values)
    loaded = with_values(loaded, {**loaded.values, **loaded.given})
    for name, variable in loaded.assignment.variables.items():
        if name not in loaded.given and not variable.is_of_runs:
            example = loaded.values[name]
            say(f"{name} is {example} in these files; choose another with --set {name}=VALUE")
    for written in write_starter(loaded, folder, cpp=cpp):
        say(f"Written: {written}")
    workspace = folder.parent if folder.name == "src" else folder
    say("\nNext, read the task, then grade your work after every save:\n")
    say(f"  rosgrade show {assignment}")
    say(f"  rosgrade watch {assignment} {shlex.quote(str(workspace))}")


def new(
    name: Annotated[
        str,
        typer.Argument(
            metavar="ID",
            help="Name of the assignment (lower case letters, digits, underscores), or a folder of "
            "this name.",
        ),
    ],
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Parent folder; by default the current folder.")
    ] = Path(),
    cpp: Annotated[
        bool, typer.Option("--cpp", help="Students may also write C++; adds a reference in C++.")
    ] = False,
) -> None:
    """Write a small new assignment that works.

    Creates a folder ID with assignment.yaml, a handout, a reference solution, and mutants:
    mistakes that must lose points. Change it step by step. Existing files are never
    overwritten.
    """
    # A name alone is its own last part, and leaves the folder as it is.
    place = folder / name
    written = write_assignment(place.name or name, place.parent, cpp=cpp)
    say(f"Written: {written}")
    say("\nNext, edit assignment.yaml in this folder, and after each change run:\n")
    say(f"  rosgrade validate {written}")
    say(f"  rosgrade selftest {written}")
    if cpp:
        say(f"  rosgrade selftest --cpp {written}")
