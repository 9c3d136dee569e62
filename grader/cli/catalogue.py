"""``rosgrade validate``, ``rosgrade schema`` and ``rosgrade checks``."""

from __future__ import annotations

import json
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer
from rich.markdown import Markdown
from rich.table import Table

from grader.assignment.contract.expand import plain
from grader.assignment.lesson_checks import all_checks
from grader.assignment.lint_warnings import lint_warnings
from grader.assignment.load import load_assignment
from grader.assignment.schema import assignment_schema, mutants_schema
from grader.authoring.documentation import check_markdown, explanations_markdown
from grader.authoring.mutants.standard import every_mutant
from grader.cli import USAGE
from grader.cli.screen.console import output_console, print_error, print_warning
from grader.course.load import COURSE_FILE, load_course
from grader.course.model import CourseFile
from grader.errors import RosgradeError, UsageError
from grader.findings.words import counted
from grader.grading.type_support import missing_underlays
from grader.report.model.result import result_schema
from grader.sandbox.python_tree import not_installed
from grader.spec.document import write_yaml
from grader.spec.nearest_name import did_you_mean


class Document(str, Enum):
    """What a schema describes."""

    ASSIGNMENT = "assignment"
    MUTANTS = "mutants"
    COURSE = "course"
    RESULT = "result"


def validate(
    files: Annotated[
        list[str],
        typer.Argument(help="assignment.yaml or course.yaml, folders, or ids of assignments."),
    ],
    whole: Annotated[
        bool,
        typer.Option(
            "--expanded",
            help="Print the YAML with all that contract and groups stand for, and stop.",
        ),
    ] = False,
) -> None:
    """Check assignments without running anything.

    Shows the file and line of every mistake, and what is allowed there.
    """
    if whole:
        for name in files:
            loaded = load_assignment(name)
            assert loaded.source is not None
            typer.echo(write_yaml(plain(loaded.source)), nl=False)
        return
    broken = 0
    for name in files:
        try:
            if Path(name).name == COURSE_FILE:
                rules = load_course(Path(name)).spec
                count = counted(len(rules.assignments), "assignment")
                typer.echo(f"{name}: rules of {count}: valid")
                continue
            loaded = load_assignment(name)
            mutants = every_mutant(loaded)
        except RosgradeError as error:
            print_error(str(error))
            broken += 1
            continue
        warnings = [*lint_warnings(loaded, mutants or None)]
        warnings += not_installed(loaded.assignment.libraries)
        warnings += missing_underlays(loaded)
        for warning in warnings:
            print_warning(f"{loaded.file}: {warning}")
        tested = f", {counted(len(mutants), 'mutant')}" if mutants else ""
        typer.echo(
            f"{loaded.file}: {counted(len(loaded.assignment.scenarios), 'scenario')}, "
            f"{counted(len(loaded.checks), 'check')}{tested}: valid"
        )
    if broken:
        raise typer.Exit(USAGE)


def schema(
    document: Annotated[Document, typer.Argument(help="Which schema.")] = Document.ASSIGNMENT,
) -> None:
    """Print the JSON Schema of a file, for editors."""
    make = {
        Document.ASSIGNMENT: lambda: assignment_schema(all_checks()),
        Document.MUTANTS: mutants_schema,
        Document.COURSE: CourseFile.model_json_schema,
        Document.RESULT: result_schema,
    }[document]
    head = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        # A name and no address: an editor takes the schema from a file.
        "$id": f"urn:rosgrade:schema:{document.value}:1",
    }
    typer.echo(json.dumps({**head, **make()}, indent=2))


def checks(
    name: Annotated[str | None, typer.Argument(help="One check; by default all checks.")] = None,
    explanations: Annotated[
        bool, typer.Option("--explanations", help="List the explanations of failed checks.")
    ] = False,
) -> None:
    """List the checks with their parameters, or the explanations."""
    console = output_console()
    if explanations:
        console.print(Markdown("\n".join(explanations_markdown().values())))
        return
    catalogue = all_checks()
    if name is None:
        table = Table("CHECK", "WHAT IT JUDGES", box=None, pad_edge=False)
        for entry in catalogue.values():
            table.add_row(entry.name, entry.title)
        console.print(table)
        console.print("\nrosgrade checks NAME tells what a check looks at and its parameters.")
        return
    if name not in catalogue:
        raise UsageError(f"no check {name!r}." + did_you_mean(name, catalogue))
    console.print(Markdown(check_markdown(catalogue[name])))
