"""What stands for the variables of an assignment in one submission, and what is wrong with it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from grader.diagnosis.no_endpoint import ACTION, PUBLISHER, SERVICE, SUBSCRIPTION, NoEndpoint
from grader.errors import AssignmentError, UsageError
from grader.findings.finding import Evidence, Finding
from grader.findings.wording import code, codes
from grader.recording.model import Recording
from grader.submission.record import SourceError, SubmissionRecord

if TYPE_CHECKING:
    from grader.assignment.load import LoadedAssignment
    from grader.assignment.variable import Values, Variable

_WORDS = {
    "publishers": PUBLISHER,
    "subscriptions": SUBSCRIPTION,
    "services": SERVICE,
    "actions": ACTION,
}
_MOST_PLACES = 10


def named(
    loaded: LoadedAssignment,
    submission: SubmissionRecord,
    recordings: Mapping[str, Recording] = {},
) -> tuple[LoadedAssignment, Finding | None]:
    """The assignment with the names of a submission in it.

    What is found only in runs is the author's example until recordings show exactly one such name.

    Returns:
        The assignment, and why the submission cannot be run: its names have not the form that is
        asked for. The assignment then has the author's examples.

    Raises:
        UsageError: The roster has no value for a variable.
    """
    variables = loaded.assignment.variables
    if not variables or submission.problem is not None:
        return loaded, None
    # Reading YAML is not needed to judge what has no variables.
    from grader.assignment.selection import with_values
    from grader.assignment.variable import form

    given, values = dict(submission.given), dict[str, str]()
    for name, variable in variables.items():
        told = given.get(name)
        if told is not None and re.fullmatch(variable.part, told):
            values[name] = told
            continue
        if told or variable.match is None:
            raise UsageError(_not_given(name, variable, told))
        offered = list(_offered(loaded, name, values, submission, recordings))
        matches = filter(None, map(form(name, variables, values).fullmatch, offered))
        found = {match["value"]: match[0] for match in matches}
        if len(found) == 1:
            values.update(dict.fromkeys([name], *found))
        elif variable.is_of_runs:
            values[name] = str(variable.example)
        else:
            fitting = list(found.values())
            return loaded, _unnamed(loaded, name, values, fitting, offered, submission)
    try:
        return with_values(loaded, values), None
    except AssignmentError as error:
        chosen = codes(f"{name}: {value}" for name, value in values.items())
        seen = f"with {chosen}, {error.problems[0].message}"
        return loaded, Finding.failed("names that ROS allows", seen, "Choose another name.")


def _not_given(name: str, variable: Variable, told: str | None) -> str:
    origin = f"the column {variable.column!r} of the roster" if variable.column else "--set"
    kind = "digits" if isinstance(variable.example, int) else "letters, digits and underscores"
    wrong = f"holds {told!r}, and not only {kind}" if told else "says nothing here"
    return f"{origin} {wrong}; it stands for {{{name}}} (for one submission: --set {name}=VALUE)"


def _offered(
    loaded: LoadedAssignment,
    name: str,
    values: Values,
    submission: SubmissionRecord,
    recordings: Mapping[str, Recording],
) -> Iterator[str]:
    """The names among which that of a variable is."""
    from grader.assignment.variable import fill_text

    variable = loaded.assignment.variables[name]
    of = variable.of and fill_text(variable.of, values)
    for package in submission.packages:
        if variable.in_ == "packages":
            yield package.name
        elif variable.in_ == "executables" and of in (None, package.name):
            yield from dict.fromkeys((*package.executables, *dict(package.entry_points)))
        elif variable.in_ == "interfaces":
            for item in (*package.definitions, *package.generated):
                file = PurePosixPath(item.file)
                yield f"{package.name}/{file.suffix[1:]}/{file.stem}"
    runs = loaded.source.data["scenarios"] if loaded.source and variable.is_of_runs else ()
    using = {run["id"] for run in runs if f"{{{name}}}" in json.dumps(run)}
    for recording in recordings.values():
        # A run of a scenario that is repeated has a number behind the name.
        if using.isdisjoint((recording.scenario, recording.scenario.rpartition("_")[0])):
            continue
        if variable.in_ == "nodes":
            yield from (node.name for node in recording.student_nodes)
        elif variable.in_ in _WORDS:
            there = NoEndpoint(recording, _WORDS[variable.in_], "").there
            yield from (item.name for item in there if of in (None, item.type))


def _unnamed(
    loaded: LoadedAssignment,
    name: str,
    values: Values,
    fitting: list[str],
    offered: list[str],
    submission: SubmissionRecord,
) -> Finding:
    """Which form was expected, and what was found."""
    from grader.assignment.variable import ANY, fill_text

    variable = loaded.assignment.variables[name]
    noun = variable.in_.removesuffix("s")
    place = f" of {code(fill_text(variable.of, values))}" if variable.of else ""
    shape = fill_text(str(variable.match), values)
    like = code(str(variable.example) if shape == ANY else fill_text(shape, loaded.values))
    of_form = "of any name" if shape == ANY else f"with a name of the form {code(shape)}"
    hint = f"Name the {noun} as {like} is named, with your own {code(name)}."
    if noun == "package":
        hint += (
            " The same name stands in package.xml, setup.py, setup.cfg, resource/ and for the "
            "folder of the Python module, or in CMakeLists.txt."
        )
    places = tuple(
        SourceError(item.file("package.xml"), None, f"the package {code(item.name)}")
        for item in submission.packages[:_MOST_PLACES]
    )
    return Finding.failed(
        f"one {noun}{place} {of_form}, such as {like}",
        f"found {codes(fitting or dict.fromkeys(offered)) or f'no {noun}'}",
        f"Hand in one {noun} of this form only." if fitting else hint,
        Evidence(places=places),
    )
