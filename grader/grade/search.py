"""The search for what a submission calls something whose name is free: by its form, or its role."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePosixPath

from grader.assignment.load import LoadedAssignment
from grader.assignment.variable import ANY, Role, Values, Variable, alike, fill, fill_text, form
from grader.diagnosis.no_endpoint import (
    ACTION,
    ACTION_CLIENT,
    CLIENT,
    PUBLISHER,
    SERVICE,
    SUBSCRIPTION,
)
from grader.diagnosis.no_executable import why_no_executable
from grader.diagnosis.not_built import why_not_built
from grader.findings.finding import Evidence, Finding, Verdict
from grader.findings.words import code, codes, listing, worded
from grader.measure import parameter_calls
from grader.recording.model import Recording
from grader.recording.submission import PackageRecord, SourceError, SourceFile, SubmissionRecord
from grader.submission.read.answers import FILE as ANSWERS_FILE
from grader.submission.read.cmake import read_commands
from grader.submission.read.includes import with_own_headers
from grader.submission.read.reachable import only_for

_KINDS = {
    "publishers": PUBLISHER,
    "subscriptions": SUBSCRIPTION,
    "services": SERVICE,
    "actions": ACTION,
}
_DONE_BY = {
    "publishes": ("publishes {on}{}", (PUBLISHER,)),
    "subscribes": ("subscribes to {}", (SUBSCRIPTION,)),
    "serves": ("offers {}", (SERVICE, ACTION)),
    "calls": ("has a client of {}", (CLIENT, ACTION_CLIENT)),
}
"""How it is said that a node does something, and what it then has."""
_IN_SHARE = re.compile(r"(?:launch/)?[^/]*launch\.(?:py|xml|ya?ml)")
_TYPE = re.compile(r"\w+/(?:msg|srv|action)/\w+")
_MOST_PLACES = 10


@dataclass(frozen=True)
class Search:
    """The search for the name that a submission has in the place of a variable.

    Attributes:
        variable: What the assignment says of it.
        values: Of the variables above it.
    """

    loaded: LoadedAssignment
    submission: SubmissionRecord
    recordings: Mapping[str, Recording]
    name: str
    variable: Variable
    values: Values

    @property
    def of(self) -> str | None:
        """The package or the type to which the search is limited, or None."""
        return self.variable.of and fill_text(self.variable.of, self.values)

    @property
    def role(self) -> Role:
        """What is looked for does this, with the names that are known."""
        written = self.variable.where or Role()
        return Role(**fill(written.model_dump(mode="json", exclude_defaults=True), self.values))

    @property
    def noun(self) -> str:
        """What it is, in the words of ROS."""
        return self.variable.in_.removesuffix("s").replace("_", " ")

    def found(self) -> dict[str, str]:
        """The names of its form, by what is chosen in them."""
        pattern = form(self.name, self.loaded.assignment.variables, self.values)
        matches = filter(None, map(pattern.fullmatch, self.offered()))
        return {match["value"]: match[0] for match in matches}

    def chosen(self) -> str | None:
        """The only one; of several of one role, each has the next in the order of their names."""
        names = self._free()
        open_variables = [one for one in self._same if one == self.name or one not in self.values]
        place = open_variables.index(self.name)
        if len(names) > len(open_variables) or place >= len(names):
            return None
        return names[place]

    @property
    def is_open(self) -> bool:
        """Whether there are more of a free name than are asked for."""
        return self.variable.match == ANY and len(self._free()) > 1

    @property
    def others(self) -> list[str]:
        """What would be it, if it did what its role says."""
        if self.variable.where is None:
            return []
        plain = self.variable.model_copy(update={"where": None})
        return sorted(replace(self, variable=plain).found().keys() - self._taken)

    @property
    def _same(self) -> list[str]:
        return alike(self.name, self.loaded.assignment.variables) or [self.name]

    def _free(self) -> list[str]:
        """The names of its form that no other variable of the same role has."""
        return sorted(self.found().keys() - self._taken)

    @property
    def _taken(self) -> set[str]:
        """The names that other variables of the same role have."""
        return {self.values[one] for one in self._same if one in self.values and one != self.name}

    def is_of_what_was_not_built(self) -> bool:
        """Whether it is of what a build makes, and the package was not built."""
        if self.variable.in_ not in ("executables", "launch_files") or not self.submission.build:
            return False
        packages = [self.of] if self.of else [one.name for one in self.submission.packages]
        return any(why_not_built(self.submission, package) for package in packages)

    def offered(self) -> Iterator[str]:
        """The names among which it is."""
        variable, of = self.variable, self.of
        if variable.in_ == "interfaces" and of is not None and of.startswith("/"):
            yield from self._interfaces_in_use(of)
            return
        for package in self.submission.packages:
            if variable.in_ == "packages":
                yield package.name
            elif of not in (None, package.name):
                continue
            elif variable.in_ == "executables":
                yield from self._programs(package)
            elif variable.in_ == "interfaces":
                yield from self._interfaces(package)
            elif variable.in_ == "launch_files":
                shared = (path for path, _ in package.shared)
                yield from (one.rpartition("/")[2] for one in shared if _IN_SHARE.fullmatch(one))
        for recording in self.runs():
            yield from self._seen(recording)

    def runs(self) -> list[Recording]:
        """The runs in which it can be seen: of the scenarios that name it, or else all."""
        if not self.variable.is_of_runs:
            return []
        source = self.loaded.source
        using = {
            run["id"]
            for run in (source.data["scenarios"] if source else ())
            if f"{{{self.name}}}" in json.dumps(run)
        }
        # A run of a scenario that is repeated has a number behind the name.
        return [
            one
            for one in self.recordings.values()
            if not using or {one.scenario, one.scenario.rpartition("_")[0]} & using
        ]

    def _seen(self, recording: Recording) -> Iterator[str]:
        variable, of, role = self.variable, self.of, self.role
        nodes = [node.name for node in recording.written_nodes]
        if variable.in_ == "nodes":
            for node in nodes:
                if all(_does(recording, node, *one) for one in role.parts):
                    yield node
        elif variable.in_ == "parameters":
            for node in nodes:
                if role.node in (None, node, node.rpartition("/")[2]):
                    for name in parameter_calls.names(recording, node):
                        declaration = parameter_calls.descriptor(recording, node, name)
                        if of is None or (declaration is not None and declaration.type == of):
                            yield name
        else:
            for item in _KINDS[variable.in_].entities(recording):
                here = role.node in (None, item.node, item.node.rpartition("/")[2])
                if here and of in (None, item.type):
                    yield item.name

    def _programs(self, package: PackageRecord) -> list[str]:
        """Executables whose source creates what the role needs, as far as its text shows.

        One file shows it best. Else a helper of a base class may create it for others, so all files
        of an executable count together; and CMakeLists.txt may not say which these are.
        """
        needed = {one: only_for(package, one) for one in programs_of(package)}
        looks = (
            {
                name: [_with_headers(one, part) for one in part.sources]
                for name, part in needed.items()
            },
            {name: [part.sources] for name, part in needed.items()},
            {name: [package.sources] for name in needed},
        )
        doing = (
            [name for name, files in look.items() if self._is_done_in(files)] for look in looks
        )
        return next(filter(None, doing), [])

    def _is_done_in(self, looks: Sequence[Sequence[SourceFile]]) -> bool:
        """Whether each part of the role is done by some of these groups of files."""
        return all(any(_creates(files, *one) for files in looks) for one in self.role.parts)

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
        types_in_use = {
            item.type
            for recording in self.recordings.values()
            for kind in _KINDS.values()
            for item in kind.entities(recording)
            if item.name == name
        }
        return [interface for interface in own if interface in types_in_use] or own[:1]

    @property
    def asked(self) -> str:
        """What is looked for, such as ``node that publishes on `/cmd_vel` ``."""
        does = f" that {_said(self.role.parts)}" if self.role.parts else ""
        node = f" of the node {code(self.role.node)}" if self.role.node else ""
        place = f" of {code(self.of)}" if self.of else ""
        return f"{self.noun}{place}{node}{does}"

    @property
    def reason(self) -> str:
        """Why a name is taken for it."""
        found = sorted(self.found())
        return f"the only {self.asked}" if len(found) == 1 else f"one {self.asked}: {codes(found)}"

    def why_open(self) -> Finding:
        """Which of several is meant is a question, and costs nothing."""
        found = self._free()
        line = code(f"{self.name}: {found[0]}")
        return Finding(
            f"there are {codes(found)}, and it cannot be seen which of them is meant",
            f"Say which one: hand in a file {code(ANSWERS_FILE)} too, with a line such as {line}.",
            verdict=Verdict.ASKS,
            expected=f"one {self.asked}",
        )

    def why_wrong(self, answer: str) -> Finding | None:
        """Why what the submission says is not what is looked for, as far as that is known."""
        right = {*self.found()}
        if not self.variable.is_of_runs:
            # The source shows roughly what a program does, and surely whether it is there.
            right |= {*self.others}
        if answer in right or not (right or self.others):
            return None
        if not right:
            return self.why_none()
        return Finding(
            f"{code(ANSWERS_FILE)} says {code(answer)}, and there is {codes(sorted(right))}",
            f"Correct the line of {code(self.name)} in it.",
            verdict=Verdict.ASKS,
            expected=f"one {self.asked}",
        )

    def why_none(self) -> Finding:
        """Which form was expected, and what was found."""
        variable = self.variable
        if self.others:
            seen, hint = f"found only {codes(self.others)}", ""
            if variable.in_ == "nodes":
                lacks = {
                    node: [one for one in self.role.parts if not _does(run, node, *one)]
                    for run in self.runs()
                    for node in self.others
                }
                best = min(lacks, key=lambda node: len(lacks[node]))
                seen += f"; {code(best)} comes nearest, and lacks this: {_said(lacks[best])}"
                hint = f"Add it there. {code(f'ros2 node info {best}')} lists what the node has."
            beside = f" beside {codes(sorted(self._taken))}" if self._taken else ""
            return Finding.failed(f"one {self.asked}{beside}, under any name", seen, hint)
        offered, fitting = list(self.offered()), self.found().values()
        shape = fill_text(str(variable.match), self.values)
        like = code(str(variable.example) if shape == ANY else fill_text(shape, self.loaded.values))
        of_form = "of any name" if shape == ANY else f"with a name of the form {code(shape)}"
        hint = f"Name the {self.noun} as {like} is named, with your own {code(self.name)}."
        if variable.in_ == "packages":
            hint += worded(
                python=" The same name stands in package.xml, setup.py, setup.cfg, resource/ and "
                "for the folder of the Python module, or in CMakeLists.txt.",
                cpp=" The same name stands in package.xml and in project(...) of CMakeLists.txt.",
            )
        asked = f"one {self.asked} {of_form}, such as {like}"
        if variable.in_ == "executables" and self.of and not offered:
            cause = why_no_executable(self.submission, self.of, str(variable.example))
            if cause is not None:
                return replace(cause, expected=asked)
        return Finding.failed(
            asked,
            f"found {codes(fitting or dict.fromkeys(offered)) or f'no {self.noun}'}",
            f"Hand in one {self.noun} of this form only." if fitting else hint,
            Evidence(places=self._places()),
        )

    def _places(self) -> tuple[SourceError, ...]:
        """The files that name what is there."""
        is_program = self.variable.in_ == "executables"
        return tuple(
            SourceError(
                item.file(_defining(item, is_program)), None, f"the package {code(item.name)}"
            )
            for item in self.submission.packages[:_MOST_PLACES]
            if not is_program or self.of in (None, item.name)
        )


def _is(wanted: str, name: str, type_: str) -> bool:
    """Whether a whole name, the end of one, or a type is meant by a text."""
    if _TYPE.fullmatch(wanted):
        return type_ == wanted
    return wanted == (name if wanted.startswith("/") else name.rpartition("/")[2])


def _said(parts: Iterable[tuple[str, str]]) -> str:
    """Parts of a role, for people."""
    return listing(
        _DONE_BY[key][0].format(code(wanted), on="" if _TYPE.fullmatch(wanted) else "on ")
        for key, wanted in parts
    )


def _does(recording: Recording, node: str, key: str, wanted: str) -> bool:
    """Whether a node does in a run what a part of a role says."""
    return any(
        item.node == node and _is(wanted, item.name, item.type)
        for kind in _DONE_BY[key][1]
        for item in kind.entities(recording)
    )


def _with_headers(source: SourceFile, package: PackageRecord) -> list[SourceFile]:
    """A file, and the headers of its package that it includes."""
    read = with_own_headers([source.path], package.own_headers)
    return [one for one in package.sources if one.path in read]


def _creates(files: Sequence[SourceFile], key: str, wanted: str) -> bool:
    """Whether files create together what a role says."""
    functions = {name for kind in _DONE_BY[key][1] for name in kind.functions}
    made = [one for file in files for one in file.calls if one.short in functions]
    if not _TYPE.fullmatch(wanted):
        return any(_is(wanted, f"/{one.literal.lstrip('/')}", "") for one in made)
    return bool(made) and any(_names(file, wanted) for file in files)


def _names(source: SourceFile, wanted: str) -> bool:
    """Whether a file imports or includes a type."""
    package, kind, name = wanted.split("/")
    header = f"{wanted}.hpp".lower().replace("_", "")
    imported = dict(source.names).values()
    return (
        f"{package}.{kind}.{name}" in imported
        or (name in source.uses and bool({package, f"{package}.{kind}"} & {*imported}))
        or any(one.lower().replace("_", "") == header for one, _, _ in source.includes)
    )


def programs_of(package: PackageRecord) -> list[str]:
    """Executables of a package, by what was built, or else by what it says."""
    found = [*package.executables, *dict(package.entry_points)]
    if not found:
        commands = read_commands(package.cmake or "")
        found = [one.arguments[0] for one in commands if one.name == "add_executable"]
    return list(dict.fromkeys(found))


def _defining(package: PackageRecord, is_program: bool) -> str:
    """The file that names an executable, or anything else of a package."""
    if not is_program:
        return "package.xml"
    return "setup.py" if package.build_type == "ament_python" else "CMakeLists.txt"
