"""What stands for the variables of an assignment in one submission, and what is wrong with it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import PurePosixPath
from typing import NamedTuple

from grader.assignment.contract.expand import expanded
from grader.assignment.load import LoadedAssignment
from grader.assignment.selection import with_values
from grader.assignment.variable import Variable, alike
from grader.checks.interface.interface import Found as InterfaceFound
from grader.checks.interface.interface import OfInterface
from grader.checks.package.package import PackageFound
from grader.diagnosis.not_generated import find_definition
from grader.errors import AssignmentError, UsageError
from grader.findings.finding import Finding, Verdict
from grader.findings.words import code, codes
from grader.grade.model import Chosen
from grader.grade.search import Search, programs_of
from grader.recording.model import Recording
from grader.recording.submission import SubmissionRecord
from grader.spec.name import INTERFACE
from grader.spec.names import Names, Thing, WrongName
from grader.spec.nearest_name import meant, nearest, nearest_or_all
from grader.submission.read.answers import FILE as ANSWERS_FILE


@dataclass(frozen=True)
class Unnamed:
    """A name of a submission that is not known: none fits, or it is a question which one is meant.

    Attributes:
        variables: Those that have no value by that.
        can_run: Whether that shows only in runs, in which the author's examples are asked for.
    """

    finding: Finding
    variables: frozenset[str]
    can_run: bool = False


@dataclass(frozen=True)
class ChosenNames:
    """An assignment with a submission's own names, and the submission, which says what is wrong.

    Attributes:
        unnamed: Those that are not known. The author's examples then stand for them.
        chosen: Those that were described, or that the submission itself says.
    """

    loaded: LoadedAssignment
    submission: SubmissionRecord
    unnamed: tuple[Unnamed, ...] = ()
    chosen: tuple[Chosen, ...] = ()


def with_chosen_names(
    loaded: LoadedAssignment,
    submission: SubmissionRecord,
    recordings: Mapping[str, Recording] = {},
) -> ChosenNames:
    """Fill the student's own names in, and note in the submission which names are wrong.

    An assignment may ask for ``group{n}_bot``, and this submission has ``group7_bot``. The roster
    comes first, then what the submission says in ``rosgrade.yaml``, then what is found in it.
    What is found only in runs is the author's example until recordings show exactly one such name.
    So is an executable of what was not built: that is told first.

    Raises:
        UsageError: The roster has no value for a variable.
    """
    loaded, unnamed, chosen = _with_chosen(loaded, submission, recordings)
    packages = Names.of(_other_packages(loaded, submission))
    submission = replace(submission, names=packages)
    interfaces = Names.of(_other_interfaces(loaded, submission))
    submission = replace(submission, names=packages | interfaces)
    return ChosenNames(_with_own_types(loaded, submission), submission, unnamed, chosen)


class _Choice(NamedTuple):
    """What stands for a free name, why that is not right, and where it is right, why it is taken.

    The author's example stands for what is not found.
    """

    value: str
    wrong: Finding | None = None
    why: str = ""


def _with_chosen(
    loaded: LoadedAssignment, submission: SubmissionRecord, recordings: Mapping[str, Recording]
) -> tuple[LoadedAssignment, tuple[Unnamed, ...], tuple[Chosen, ...]]:
    """The assignment with a submission's values of its variables, and why some have none."""
    variables = loaded.assignment.variables
    if not variables or submission.problem is not None:
        return loaded, (), ()
    wrong = _wrong_answer(variables, submission)
    if wrong is not None:
        return loaded, (Unnamed(wrong, frozenset(variables)),), ()
    answers = {name: variables[name].whole(value) for name, value in submission.answers}
    values: dict[str, str] = {}
    unnamed: dict[str, Unnamed] = {}
    chosen: list[Chosen] = []
    for name, variable in variables.items():
        given = _given(name, variable, submission)
        if given is not None:
            values[name] = given
            continue
        search = Search(loaded, submission, recordings, name, variable, {**answers, **values})
        choice = _choice(search, answers.get(name), unnamed)
        values[name] = choice.value
        if choice.wrong is not None:
            shows_in_runs = variable.is_of_runs or search.is_of_what_was_not_built()
            can_run = shows_in_runs or not _is_used_in_runs(name, loaded)
            unnamed[name] = Unnamed(choice.wrong, frozenset((name,)), can_run)
        elif choice.why:
            chosen.append(Chosen(name, choice.value, choice.why))
    try:
        return with_values(loaded, values), tuple(unnamed.values()), tuple(chosen)
    except AssignmentError as error:
        names = codes(f"{name}: {value}" for name, value in values.items())
        seen = f"with {names}, {error.problems[0].message}"
        wrong = Finding.failed("names that ROS allows", seen, "Choose another name.")
        if answers:
            wrong = replace(wrong, verdict=Verdict.ASKS, hint=f"Look at {code(ANSWERS_FILE)}.")
        return loaded, (Unnamed(wrong, frozenset(variables)),), ()


def _given(name: str, variable: Variable, submission: SubmissionRecord) -> str | None:
    """The value that the roster or ``--set`` gives, or None where a search may find one."""
    value = dict(submission.given).get(name)
    if value is not None and re.fullmatch(variable.part, value):
        return value
    if value or variable.match is None:
        raise UsageError(_not_given(name, variable, value))
    return None


def _choice(search: Search, answer: str | None, unnamed: Mapping[str, Unnamed]) -> _Choice:
    """What stands for a free name: what the submission says, or what is found in it."""
    variable = search.variable
    if answer is not None:
        return _Choice(answer, search.why_wrong(answer), f"as {code(ANSWERS_FILE)} says")
    example = str(variable.example)
    for name, item in unnamed.items():
        # Of what is not known nothing can be found, such as an executable of a package.
        if f"{{{name}}}" in f"{variable.match} {variable.of} {variable.where}":
            return _Choice(example, item.finding)
    found = search.chosen()
    if found is not None:
        return _Choice(found, why=search.reason if variable.where is not None else "")
    if search.is_open:
        return _Choice(example, search.why_open())
    # Why a run does not show it, or why it was not built, is told by the checks of that.
    is_told = variable.is_of_runs or search.is_of_what_was_not_built()
    return _Choice(example, search.why_none() if search.others or not is_told else None)


def _is_used_in_runs(name: str, loaded: LoadedAssignment) -> bool:
    """Whether no run can be made without a name: a launch file needs none of an executable."""
    source = expanded(loaded.source) if loaded.source else None
    return source is not None and f"{{{name}}}" in json.dumps(source.data.get("scenarios"))


def _wrong_answer(
    variables: Mapping[str, Variable], submission: SubmissionRecord
) -> Finding | None:
    """What is wrong with the file in which a submission says what is meant, or None."""
    wrong = submission.answers_problem
    if not wrong:
        for name, _ in submission.answers:
            wrong = _why_not_yours(name, variables, submission) or wrong
    if not wrong:
        return None
    asked = f"a line such as `name: value` for each name in {code(ANSWERS_FILE)}"
    return Finding(wrong, "Correct the file.", verdict=Verdict.ASKS, expected=asked)


def _why_not_yours(
    name: str, variables: Mapping[str, Variable], submission: SubmissionRecord
) -> str:
    """What is wrong with one line of that file, or nothing."""
    variable, answers = variables.get(name), dict(submission.answers)
    value = answers[name]
    if variable is None:
        return f"there is no name {name!r} to choose.{nearest_or_all(name, variables)}"
    if variable.match is None or variable.column is not None:
        return f"{name!r} is not yours to choose: it is given"
    if not re.fullmatch(variable.part, value):
        return f"{name!r} cannot be {value!r}: its form is {variable.match}"
    whole = variable.whole(value)
    for other in alike(name, variables):
        if other != name and other in answers and variable.whole(answers[other]) == whole:
            return f"{name!r} and {other!r} cannot both be {whole!r}"
    return ""


def _not_given(name: str, variable: Variable, value: str | None) -> str:
    origin = f"the column {variable.column!r} of the roster" if variable.column else "--set"
    kind = "digits" if isinstance(variable.example, int) else "letters, digits and underscores"
    wrong = f"holds {value!r}, and not only {kind}" if value else "says nothing here"
    return f"{origin} {wrong}; it stands for {{{name}}} (for one submission: --set {name}=VALUE)"


def _other_packages(loaded: LoadedAssignment, submission: SubmissionRecord) -> Iterator[WrongName]:
    """Packages under other names: the only one with an executable asked for, or the nearest name.

    If `bot_publisher` is asked for and there is only `bot_pubisher`, that one is judged, and the
    wrong name costs one check.
    """
    asked = {package.name: package for package in loaded.assignment.packages}
    lacking = {
        bound.parameters.package
        for bound in loaded.checks
        if isinstance(bound.parameters, PackageFound) and bound.parameters.remap
    }
    taken = set(asked)
    for name in sorted(lacking - {package.name for package in submission.packages}):
        programs = set(asked[name].executables) if name in asked else set()
        others = [
            package
            for package in submission.packages
            if package.name not in taken and package.manifest_error is None
        ]
        having = [one.name for one in others if programs.intersection(programs_of(one))]
        if len(having) == 1:
            own: str | None = having[0]
        else:
            own = nearest(name, having or [package.name for package in others])
        if own is not None:
            taken.add(own)
            yield WrongName(Thing.PACKAGE, own, name)


def _other_interfaces(
    loaded: LoadedAssignment, submission: SubmissionRecord
) -> Iterator[WrongName]:
    """Interfaces under other names: the only other one of the kind, or that of the nearest name."""
    checks = [one.parameters for one in loaded.checks if isinstance(one.parameters, OfInterface)]
    asked = {parameters.interface for parameters in checks}
    for parameters in checks:
        name = parameters.parts
        package = submission.package(name.package)
        if not isinstance(parameters, InterfaceFound) or not parameters.remap or package is None:
            continue
        if not isinstance(find_definition(submission, name), Finding):
            continue
        paths = [PurePosixPath(item.file) for item in package.definitions]
        place = PurePosixPath(package.file(name.kind)), f".{name.kind}"
        names = [path.stem for path in paths if (path.parent, path.suffix) == place]
        free = [other for other in names if str(replace(name, name=other)) not in asked]
        other = meant(name.name, free)
        own = f"{package.name}/{name.kind}/{other}"
        if other is not None and re.fullmatch(INTERFACE, own):
            yield WrongName(Thing.INTERFACE, own, parameters.interface)


def _with_own_types(loaded: LoadedAssignment, submission: SubmissionRecord) -> LoadedAssignment:
    """The assignment with the student's names of interfaces: the probe cannot rename them."""
    own = {}
    for name in submission.names.wrong:
        package = submission.package(name.asked)
        if name.thing is Thing.INTERFACE:
            own[name.asked] = name.own
        elif package is not None and package.definitions:
            own[f"{name.asked}/"] = f"{name.own}/"
    if not own:
        return loaded
    try:
        return with_values(loaded, {**loaded.values, **own})
    except AssignmentError:
        return loaded
