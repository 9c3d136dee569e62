"""What stands for the variables of an assignment in one submission, and what is wrong with it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import PurePosixPath

from grader.assignment.load import LoadedAssignment
from grader.assignment.selection import with_values
from grader.assignment.variable import ANY, Values, Variable, fill_text, form
from grader.checks.interface.interface import Found as InterfaceFound
from grader.checks.interface.interface import OfInterface
from grader.checks.package.package import PackageFound
from grader.diagnosis.no_endpoint import ACTION, PUBLISHER, SERVICE, SUBSCRIPTION, NoEndpoint
from grader.diagnosis.no_executable import why_no_executable
from grader.diagnosis.not_built import why_not_built
from grader.diagnosis.not_generated import find_definition
from grader.errors import AssignmentError, UsageError
from grader.findings.finding import Evidence, Finding
from grader.findings.words import code, codes, worded
from grader.recording.model import Recording
from grader.recording.submission import PackageRecord, SourceError, SubmissionRecord
from grader.spec.name import INTERFACE
from grader.spec.names import Names, Thing, WrongName
from grader.spec.nearest_name import meant, nearest
from grader.submission.read.cmake import read_commands

_WORDS = {
    "publishers": PUBLISHER,
    "subscriptions": SUBSCRIPTION,
    "services": SERVICE,
    "actions": ACTION,
}
_MOST_PLACES = 10


@dataclass(frozen=True)
class Unnamed:
    """A name of a submission that has not the form that is asked for: it cannot be run.

    Attributes:
        variables: Those that have no value by that.
    """

    finding: Finding
    variables: frozenset[str]


@dataclass(frozen=True)
class ChosenNames:
    """An assignment with a submission's own names, and the submission, which says what is wrong.

    Attributes:
        unnamed: Why it cannot be run. The author's examples then stand for what was not found.
    """

    loaded: LoadedAssignment
    submission: SubmissionRecord
    unnamed: Unnamed | None


def with_chosen_names(
    loaded: LoadedAssignment,
    submission: SubmissionRecord,
    recordings: Mapping[str, Recording] = {},
) -> ChosenNames:
    """Fill the student's own names in, and note in the submission which names are wrong.

    An assignment may ask for ``group{n}_bot``, and this submission has ``group7_bot``.
    What is found only in runs is the author's example until recordings show exactly one such name.
    So is an executable of what was not built: that is told first.

    Raises:
        UsageError: The roster has no value for a variable.
    """
    loaded, unnamed = _with_chosen(loaded, submission, recordings)
    packages = Names.of(_other_packages(loaded, submission))
    submission = replace(submission, names=packages)
    interfaces = Names.of(_other_interfaces(loaded, submission))
    submission = replace(submission, names=packages | interfaces)
    return ChosenNames(_with_own_types(loaded, submission), submission, unnamed)


def _with_chosen(
    loaded: LoadedAssignment, submission: SubmissionRecord, recordings: Mapping[str, Recording]
) -> tuple[LoadedAssignment, Unnamed | None]:
    """The assignment with a submission's values of its variables, and why one has none."""
    variables = loaded.assignment.variables
    if not variables or submission.problem is not None:
        return loaded, None
    given, values = dict(submission.given), dict[str, str]()
    unnamed = None
    for name, variable in variables.items():
        told = given.get(name)
        if told is not None and re.fullmatch(variable.part, told):
            values[name] = told
            continue
        if told or variable.match is None:
            raise UsageError(_not_given(name, variable, told))
        search = _Search(loaded, submission, recordings, name, values)
        found = search.found()
        if len(found) == 1:
            (values[name],) = found
        elif variable.is_of_runs or search.is_of_what_was_not_built():
            values[name] = str(variable.example)
        else:
            unnamed = Unnamed(search.why_none(), frozenset(variables.keys() - values.keys()))
            values = {**loaded.values, **values}
            break
    try:
        return with_values(loaded, values), unnamed
    except AssignmentError as error:
        chosen = codes(f"{name}: {value}" for name, value in values.items())
        seen = f"with {chosen}, {error.problems[0].message}"
        why = Finding.failed("names that ROS allows", seen, "Choose another name.")
        return loaded, Unnamed(why, frozenset(variables))


def _not_given(name: str, variable: Variable, told: str | None) -> str:
    origin = f"the column {variable.column!r} of the roster" if variable.column else "--set"
    kind = "digits" if isinstance(variable.example, int) else "letters, digits and underscores"
    wrong = f"holds {told!r}, and not only {kind}" if told else "says nothing here"
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
        having = [one.name for one in others if programs.intersection(_programs(one))]
        only = having[0] if len(having) == 1 else None
        if own := only or nearest(name, having or [one.name for one in others]):
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
        paths = [PurePosixPath(one.file) for one in package.definitions]
        folder = PurePosixPath(package.file(name.kind))
        names = [one.stem for one in paths if (one.parent, one.suffix) == (folder, f".{name.kind}")]
        others = [one for one in names if str(replace(name, name=one)) not in asked]
        other = meant(name.name, others)
        if other and re.fullmatch(INTERFACE, own := f"{package.name}/{name.kind}/{other}"):
            yield WrongName(Thing.INTERFACE, own, parameters.interface)


def _with_own_types(loaded: LoadedAssignment, submission: SubmissionRecord) -> LoadedAssignment:
    """The assignment with the student's names of interfaces: the probe cannot rename them."""
    own = {}
    for one in submission.names.wrong:
        if one.thing is Thing.INTERFACE:
            own[one.asked] = one.own
        elif (package := submission.package(one.asked)) and package.definitions:
            own[f"{one.asked}/"] = f"{one.own}/"
    try:
        return with_values(loaded, {**loaded.values, **own}) if own else loaded
    except AssignmentError:
        return loaded


@dataclass(frozen=True)
class _Search:
    """The search for the name that a submission has in the place of a variable.

    Attributes:
        values: Of the variables above it.
    """

    loaded: LoadedAssignment
    submission: SubmissionRecord
    recordings: Mapping[str, Recording]
    name: str
    values: Values

    @property
    def variable(self) -> Variable:
        """What the assignment says of it."""
        return self.loaded.assignment.variables[self.name]

    @property
    def of(self) -> str | None:
        """The package or the type to which the search is limited, or None."""
        return self.variable.of and fill_text(self.variable.of, self.values)

    def found(self) -> dict[str, str]:
        """The names of its form, by what is chosen in them."""
        pattern = form(self.name, self.loaded.assignment.variables, self.values)
        matches = filter(None, map(pattern.fullmatch, self.offered()))
        return {match["value"]: match[0] for match in matches}

    def is_of_what_was_not_built(self) -> bool:
        """Whether it is of what a build makes, and the package was not built."""
        if self.variable.in_ != "executables" or self.submission.build is None:
            return False
        packages = [self.of] if self.of else [one.name for one in self.submission.packages]
        return any(why_not_built(self.submission, package) for package in packages)

    def _interfaces(self, package: PackageRecord) -> Iterator[str]:
        """Interfaces of a package; of those of any name, what has the kind of the example."""
        for item in (*package.definitions, *package.generated):
            file = PurePosixPath(item.file)
            kind = file.suffix[1:]
            if self.variable.kind in ("", kind):
                yield f"{package.name}/{kind}/{file.stem}"

    def _interfaces_in_use(self, name: str) -> list[str]:
        """The student's interfaces of a topic, a service or an action in the runs.

        Before any run, and where nothing is seen of it, one stands for all.
        """
        own = [one for package in self.submission.packages for one in self._interfaces(package)]
        there = [
            item
            for recording in self.recordings.values()
            for noun in _WORDS.values()
            for item in NoEndpoint(recording, noun, "").there
        ]
        seen = {item.type for item in there if item.name == name}
        return [one for one in own if one in seen] or own[:1]

    def offered(self) -> Iterator[str]:
        """The names among which it is."""
        variable, of = self.variable, self.of
        if variable.in_ == "interfaces" and of is not None and of.startswith("/"):
            yield from self._interfaces_in_use(of)
            return
        for package in self.submission.packages:
            if variable.in_ == "packages":
                yield package.name
            elif variable.in_ == "executables" and of in (None, package.name):
                yield from _programs(package)
            elif variable.in_ == "interfaces" and of in (None, package.name):
                yield from self._interfaces(package)
        source = self.loaded.source
        runs = source.data["scenarios"] if source and variable.is_of_runs else ()
        using = {run["id"] for run in runs if f"{{{self.name}}}" in json.dumps(run)}
        for recording in self.recordings.values():
            # A run of a scenario that is repeated has a number behind the name.
            if using.isdisjoint((recording.scenario, recording.scenario.rpartition("_")[0])):
                continue
            if variable.in_ == "nodes":
                yield from (node.name for node in recording.student_nodes)
            elif variable.in_ in _WORDS:
                there = NoEndpoint(recording, _WORDS[variable.in_], "").there
                yield from (item.name for item in there if of in (None, item.type))

    def why_none(self) -> Finding:
        """Which form was expected, and what was found."""
        variable, of = self.variable, self.of
        offered, fitting = list(self.offered()), self.found().values()
        noun = variable.in_.removesuffix("s")
        place = f" of {code(of)}" if of else ""
        shape = fill_text(str(variable.match), self.values)
        like = code(str(variable.example) if shape == ANY else fill_text(shape, self.loaded.values))
        of_form = "of any name" if shape == ANY else f"with a name of the form {code(shape)}"
        hint = f"Name the {noun} as {like} is named, with your own {code(self.name)}."
        if noun == "package":
            hint += worded(
                python=" The same name stands in package.xml, setup.py, setup.cfg, resource/ and "
                "for the folder of the Python module, or in CMakeLists.txt.",
                cpp=" The same name stands in package.xml and in project(...) of CMakeLists.txt.",
            )
        asked = f"one {noun}{place} {of_form}, such as {like}"
        if noun == "executable" and of and not offered:
            cause = why_no_executable(self.submission, of, str(variable.example))
            if cause is not None:
                return replace(cause, expected=asked)
        places = tuple(
            SourceError(item.file(_defining(item, noun)), None, f"the package {code(item.name)}")
            for item in self.submission.packages[:_MOST_PLACES]
            if noun != "executable" or of in (None, item.name)
        )
        return Finding.failed(
            asked,
            f"found {codes(fitting or dict.fromkeys(offered)) or f'no {noun}'}",
            f"Hand in one {noun} of this form only." if fitting else hint,
            Evidence(places=places),
        )


def _programs(package: PackageRecord) -> list[str]:
    """Executables of a package, by what was built, or else by what it says."""
    found = [*package.executables, *dict(package.entry_points)]
    if not found:
        commands = read_commands(package.cmake or "")
        found = [one.arguments[0] for one in commands if one.name == "add_executable"]
    return list(dict.fromkeys(found))


def _defining(package: PackageRecord, noun: str) -> str:
    """The file that names an executable, or anything else of a package."""
    if noun != "executable":
        return "package.xml"
    return "setup.py" if package.build_type == "ament_python" else "CMakeLists.txt"
