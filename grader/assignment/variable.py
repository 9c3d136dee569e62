"""Names that students, groups or the roster choose, and the places of the YAML where they stand."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal

from pydantic import Field, model_validator

from grader.errors import AssignmentError, Problem
from grader.spec.source import Model, Source

KEY = "variables"
ANY = "any"
_PLACE = re.compile(r"(?<!\$)\{([a-z][a-z0-9_]*)\}")
_STEPS = 3
_DOES = ("publishes", "subscribes", "serves", "calls")
_UNDESCRIBED = ("packages", "interfaces", "launch_files")
_NUMBER = re.compile(r"0|[1-9][0-9]*")

Values = Mapping[str, str]
"""What stands for each variable by its name, for an interface, or for a ``package/`` of them."""


class Role(Model):
    """What is looked for does this, where its name says nothing.

    Each is a whole name such as `/scan`, the end of one such as `cmd_vel`, or a type such as
    `geometry_msgs/msg/Twist`; with several, each of them.
    """

    publishes: str | tuple[str, ...] = Field((), description="Topics, or types of messages.")
    subscribes: str | tuple[str, ...] = Field((), description="Topics, or types of messages.")
    serves: str | tuple[str, ...] = Field((), description="Services and actions, or their types.")
    calls: str | tuple[str, ...] = Field(
        (), description="Services and actions that it is a client of, or their types."
    )
    node: str | None = Field(None, description="The node that has it.")

    @property
    def parts(self) -> list[tuple[str, str]]:
        """What a node or an executable does: each key with a name or a type."""
        parts = []
        for key in _DOES:
            names = getattr(self, key)
            parts += [(key, name) for name in ((names,) if isinstance(names, str) else names)]
        return parts


class Variable(Model):
    """A name that a student, a group or the roster chooses; `{name}` stands for it.

    `{name}` may stand in every text of the YAML: in packages, executables, types, topics, files,
    parameters, titles and hints; and in `interfaces/`, in texts and in names of folders and files.
    A text that begins with a brace, or is inside `{}` or `[]`, needs quotes. Alone, a number is a
    number. Braces around any other name stay as they are.
    """

    match: str | None = Field(
        None,
        description="Form of the name in what was handed in, such as `group{n}_gp2`: `{n}` is the "
        "part that was chosen, of letters, digits and underscores. `any`: the whole name is free, "
        "and there is exactly one (of interfaces, one of the kind that the example has).",
    )
    in_: Literal[
        "packages",
        "executables",
        "interfaces",
        "nodes",
        "publishers",
        "subscriptions",
        "services",
        "actions",
        "parameters",
        "launch_files",
    ] = Field(
        "packages",
        alias="in",
        description="Where a name of this form is looked for. `nodes`, `services`, `actions`, "
        "`parameters` and the topics of `publishers` and `subscriptions` are found in runs: where "
        "the student has another name than the example, the run is repeated with that name.",
    )
    of: str | None = Field(
        None,
        description="Only executables or launch files of this package; only publishers, "
        "subscriptions, services, actions or parameters of this type; only interfaces of this "
        "package, or the one that this topic, service or action has in the runs, such as "
        "`/victims`.",
    )
    where: Role | None = Field(
        None,
        description="What a node or an executable does that is meant, in the runs or by its "
        "source; or the `node` that has the topic, service, action or parameter.",
    )
    column: str | None = Field(
        None,
        description="Column of the roster with the value. Without a roster, `--set NAME=VALUE` "
        "says it, or `match` finds it.",
    )
    example: str | int = Field(
        description="A possible value, which the reference and the starter package have. If it is "
        "a number, only digits can be chosen.",
    )

    @model_validator(mode="after")
    def _has_origin(self) -> Variable:
        if self.match is None and self.column is None:
            raise ValueError("give a 'match', such as group{n}_bot or any, or a 'column'")
        if not re.fullmatch(self.part, str(self.example)):
            raise ValueError("the 'example' must be of letters, digits and underscores")
        if self.where is not None:
            self._check_role(self.where)
        return self

    def _check_role(self, role: Role) -> None:
        """Nodes and executables do something; what else is looked for is had by a node."""
        said = {key for key, _ in role.parts}
        if role.node:
            said.add("node")
        possible = {*_DOES} if self.in_ in ("nodes", "executables") else {"node"}
        if self.match != ANY or self.in_ in _UNDESCRIBED or not said <= possible:
            wrong = ", ".join(sorted(said - possible)) or "where"
            raise ValueError(f"{wrong!r} says nothing of 'match: {self.match}' in {self.in_}")

    @property
    def is_of_runs(self) -> bool:
        """Whether it is found in runs, and not in what was handed in."""
        return self.in_ not in ("packages", "executables", "interfaces", "launch_files")

    @property
    def kind(self) -> str:
        """``msg``, ``srv`` or ``action`` of an interface that may have any name, or nothing."""
        steps = str(self.example).split("/")
        return steps[1] if self.in_ == "interfaces" and len(steps) == _STEPS else ""

    def whole(self, name: str) -> str:
        """A name as it is in runs, where it begins with a slash."""
        return f"/{name.lstrip('/')}" if self.is_of_runs and self.in_ != "parameters" else name

    @property
    def is_free(self) -> bool:
        """Whether the whole name may be any."""
        return self.match == ANY

    @property
    def part(self) -> str:
        """Regular expression of its values; of `any` they are whole names."""
        if self.is_free:
            return ".+"
        return "[0-9]+" if isinstance(self.example, int) else "[A-Za-z0-9_]+"


def fill(value: Any, values: Values, key: str = "") -> Any:
    """A part of a document with the values in their places."""
    if isinstance(value, dict):
        return {fill_text(key, values): fill(item, values, key) for key, item in value.items()}
    if isinstance(value, list):
        return [fill(item, values) for item in value]
    if not isinstance(value, str):
        return value
    text = fill_text(value, values)
    if key == "type" and "/" in text:
        package, slash, rest = text.partition("/")
        return values.get(text, values.get(package + slash, package + slash) + rest)
    is_number = _PLACE.fullmatch(value) and _NUMBER.fullmatch(text)
    return int(text) if is_number else text


def fill_text(text: str, values: Values) -> str:
    """A text with the values in their places."""
    return _PLACE.sub(lambda place: values.get(place[1], place[0]), text)


def fill_interface(text: str, values: Values) -> str:
    """A text of a package of interfaces, or a path in it, with the values in their places."""
    chosen: dict[str, str] = {}
    for example, name in values.items():
        if "/" in example:
            chosen |= zip(example.split("/"), name.split("/"), strict=True)
    return re.sub(r"\w+", lambda word: chosen.get(word[0], word[0]), fill_text(text, values))


def filled(source: Source, values: Values) -> Source:
    """A document with the values in their places."""
    if not values:
        return source
    kept = {KEY: source.data[KEY]} if KEY in source.data else {}
    data = {**fill(source.data, values), **kept}
    lines = {
        tuple(fill_text(step, values) if isinstance(step, str) else step for step in place): line
        for place, line in source.lines.items()
    }
    return replace(source, data=data, lines=lines)


def alike(name: str, variables: Mapping[str, Variable]) -> list[str]:
    """The variables that stand for the same things; each takes one, in the order of their names."""
    if not variables[name].is_free:
        return []
    looked_for = _looked_for(variables[name])
    return [
        other
        for other, variable in variables.items()
        if variable.is_free and _looked_for(variable) == looked_for
    ]


def _looked_for(variable: Variable) -> tuple[object, ...]:
    """What a variable of which the whole name is free is found by."""
    return variable.in_, variable.kind, variable.of, variable.where


def form(name: str, variables: Mapping[str, Variable], values: Values) -> re.Pattern[str]:
    """The form of a variable's names; what is chosen is the group ``value``."""
    variable = variables[name]
    value = f"(?P<value>{variable.part})"
    if variable.is_free:
        return re.compile(value)
    # Text and names of variables alternate.
    steps = _PLACE.split(fill_text(str(variable.match), values))
    pattern, is_named = "", False
    for index, step in enumerate(steps):
        if index % 2 == 0:
            pattern += re.escape(step)
        elif step == name and not is_named:
            pattern, is_named = pattern + value, True
        else:
            pattern += variables[step].part
    return re.compile(pattern)


def read_variables(source: Source) -> dict[str, Variable]:
    """The variables of an assignment.

    Raises:
        AssignmentError: One is not as it must be; what else is wrong in the document shows later.
    """
    entries = source.data.get(KEY)
    entries = entries if isinstance(entries, dict) else {}
    variables: dict[str, Variable] = {}
    problems: list[Problem] = []
    for name, entry in entries.items():
        variable, mistakes = source.examine(Variable, (KEY, name))
        problems += mistakes
        if variable is None:
            continue
        in_match = {*_PLACE.findall(variable.match or "")}
        has_form = variable.match is not None and not variable.is_free
        if has_form and not (name in in_match and in_match <= {*entries}):
            text = f"{variable.match!r} must have {{{name}}} in it, and may have other variables"
            problems.append(source.problem((KEY, name, "match"), text))
        for key in ("of", "where"):
            said = entry.get(key)
            if not {*_PLACE.findall(json.dumps(said))} <= {*variables}:
                text = f"{said!r} may have only variables in it that stand above {name!r}"
                problems.append(source.problem((KEY, name, key), text))
        for other, earlier in variables.items():
            is_any = variable.is_free and variable.where is None
            is_same = _looked_for(variable)[:3] == _looked_for(earlier)[:3]
            if is_any and earlier.is_free and is_same:
                text = f"{other!r} takes any name of the {variable.in_} already: give one a form"
                text += ", another 'of', or both the same 'where'"
                problems.append(source.problem((KEY, name, "match"), text))
        variables[name] = variable
    if problems:
        raise AssignmentError(source.file, problems)
    return variables
