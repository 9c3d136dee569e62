"""YAML text to plain data with the line of every value.

Scalars are read by the core schema of YAML 1.2, as editors do: ``on``, ``yes`` and ``12:30``
are text, ``1e-3`` is a number, ``010`` is ten. (YAML 1.1, PyYAML's own, makes them true,
true, 750, text and eight.)
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import yaml
from yaml.composer import Composer
from yaml.resolver import Resolver

from grader.errors import AssignmentError, Problem

Place = tuple[str | int, ...]

_TAG = "tag:yaml.org,2002:"


class _Types(Resolver):
    """The implicit types of YAML 1.2."""

    yaml_implicit_resolvers: dict[str, Any] = {}  # noqa: RUF012 - a class variable of PyYAML


class _Loader(Composer, yaml.CSafeLoader):
    """libyaml's parser, which takes a tenth of the time of PyYAML's own, with PyYAML's composer.

    libyaml's composer would end the process where a text is nested too deeply.
    """

    yaml_implicit_resolvers = _Types.yaml_implicit_resolvers

    def __init__(self, text: str) -> None:
        yaml.CSafeLoader.__init__(self, text)
        Composer.__init__(self)


class _Explainer(yaml.SafeLoader):
    """PyYAML's own parser, which says better what is wrong with a text."""

    yaml_implicit_resolvers = _Types.yaml_implicit_resolvers


class _Dumper(yaml.SafeDumper):
    """PyYAML's writer with the same types, so that it quotes what they would read otherwise."""

    yaml_implicit_resolvers = _Types.yaml_implicit_resolvers

    def ignore_aliases(self, data: Any) -> bool:
        """Write each value out, also where several places share it."""
        return True


def _written(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    style = "|" if "\n" in text else None
    if not text.replace("\n", "").isprintable():
        # Unquoted, the other line ends of Unicode would be read as line ends.
        style = '"'
    return dumper.represent_scalar(f"{_TAG}str", text, style)


_Dumper.add_representer(str, _written)

for _name, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    ("int", r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+", list("-+0123456789")),
    (
        "float",
        r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"
        r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)",
        list("-+.0123456789"),
    ),
):
    _Types.add_implicit_resolver(_TAG + _name, re.compile(rf"(?:{_pattern})\Z"), _first)


def parse_yaml(text: str, file: Path) -> tuple[Any, dict[Place, int]]:
    """Read YAML text.

    Returns:
        Plain dicts, lists and scalars; and the line (from 1) of each value, for an entry of a
        mapping the line of its key.

    Raises:
        AssignmentError: It is not YAML, has a key twice, or uses types of its own.
    """
    reader = _Reader()
    try:
        node = _composed(text)
        data = reader.value(node, ()) if node is not None else None
    except yaml.YAMLError as error:
        raise AssignmentError(file, [_syntax(error, text)]) from error
    except RecursionError as error:
        text = "nested too deeply (does an alias contain itself?)"
        raise AssignmentError(file, [Problem(text)]) from error
    if node is None:
        raise AssignmentError(file, [Problem("the file is empty", 1)])
    if reader.problems:
        raise AssignmentError(file, reader.problems)
    return data, reader.lines


def _composed(text: str) -> yaml.Node | None:
    try:
        return yaml.compose(text, Loader=_Loader)
    except yaml.YAMLError:
        return yaml.compose(text, Loader=_Explainer)


def write_yaml(data: Any) -> str:
    """Write plain data so that :func:`parse_yaml` reads the same, and people can edit it."""
    text = yaml.dump(data, Dumper=_Dumper, allow_unicode=True, sort_keys=False, width=100)
    return str(text)


def path(place: Place) -> str:
    """Write a place as people do: ``checks[2].with.period``."""
    text = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in place)
    return text.removeprefix(".")


def places(value: Any, place: Place = ()) -> Iterator[Place]:
    """The place of a value, and the places of all that is in it."""
    yield place
    if isinstance(value, dict):
        for key, item in value.items():
            yield from places(item, (*place, key))
    elif isinstance(value, list):
        for index, item in enumerate(value):
            yield from places(item, (*place, index))


class _Reader:
    """Turns composed YAML nodes into plain data and remembers the line of each."""

    def __init__(self) -> None:
        self.lines: dict[Place, int] = {}
        self.problems: list[Problem] = []

    def value(self, node: yaml.Node, place: Place) -> Any:
        self.lines.setdefault(place, node.start_mark.line + 1)
        kind = node.tag.removeprefix(_TAG)
        if isinstance(node, yaml.MappingNode) and kind == "map":
            return self._mapping(node, place)
        if isinstance(node, yaml.SequenceNode) and kind == "seq":
            return [self.value(item, (*place, i)) for i, item in enumerate(node.value)]
        if isinstance(node, yaml.ScalarNode) and kind in _SCALARS:
            return self._scalar(node, kind, place)
        tag = f"!!{kind}" if node.tag.startswith(_TAG) else node.tag
        advice = ": a comparison needs quotes, as in '!= 0'" if tag == "!=" else ""
        self._report(node, place, f"the tag {tag} is not allowed here{advice}")
        return None

    def _mapping(self, node: yaml.MappingNode, place: Place) -> dict[str, Any]:
        result: dict[str, Any] = {}
        for key_node, value_node in node.value:
            if not isinstance(key_node, yaml.ScalarNode):
                self._report(key_node, place, "a key must be a plain word")
                continue
            key = self._scalar(key_node, "str", place)
            if key == "<<":
                text = "merging (<<) is not part of YAML 1.2: write the keys out"
                self._report(key_node, place, text)
            elif key in result:
                first = self.lines[(*place, key)]
                text = f"the key {key!r} stands twice (first in line {first})"
                self._report(key_node, place, text)
            elif key is not None:
                self.lines[(*place, key)] = key_node.start_mark.line + 1
                result[key] = self.value(value_node, (*place, key))
        return result

    def _scalar(self, node: yaml.ScalarNode, kind: str, place: Place) -> Any:
        try:
            return _SCALARS[kind](node.value)
        except (ValueError, KeyError):
            shown = node.value.encode("ascii", "backslashreplace").decode()
            shown = shown if len(shown) <= 40 else f"{shown[:40]}…"
            self._report(node, place, f"{shown!r} cannot be read as !!{kind}")
            return None

    def _report(self, node: yaml.Node, place: Place, text: str) -> None:
        self.problems.append(Problem(text, node.start_mark.line + 1, path(place)))


def _string(text: str) -> str:
    # YAML can write half of a surrogate pair, which no file or terminal can hold.
    text.encode()
    return text


_SCALARS: dict[str, Callable[[str], Any]] = {
    "null": lambda _: None,
    "bool": lambda text: {"true": True, "false": False}[text.lower()],
    "int": lambda text: int(text, {"0o": 8, "0x": 16}.get(text[:2], 10)),
    "float": lambda text: float(re.sub(r"\.(?=inf|nan)", "", text.lower())),
    "str": _string,
}

_ADVICE = {
    "found character '\\t'": "indent with spaces, not with tabs",
    "that cannot start any token": "a text that begins with it needs quotes",
    "mapping values are not allowed here": "a text with ': ' in it needs quotes, and a key "
    "stands as far to the right as the keys beside it",
    "unknown escape character": "write a text with a backslash in single quotes, as in '\\d+'",
    "expected <block end>": "does this line stand as far to the right as those that it belongs to, "
    "and is every quote before it closed?",
    "while scanning a block scalar": "a comparison needs quotes, as in '> 0'",
    "while": "is a comma, a bracket or a quote missing?",
}


def _syntax(error: yaml.YAMLError, text: str) -> Problem:
    if isinstance(error, yaml.reader.ReaderError):
        code = f"U+{ord(text[error.position]):04X}"
        message = f"not valid YAML: the control character {code}"
        return Problem(message, text.count("\n", 0, error.position) + 1)
    message = str(error).splitlines()[0]
    line: int | None = None
    if isinstance(error, yaml.MarkedYAMLError):
        context = error.context if error.context != "while scanning for the next token" else None
        message = ", ".join(filter(None, (context, error.problem)))
        mark = error.problem_mark or error.context_mark
        if "end of stream" in message or "<stream end>" in message:
            # A bracket or quote that was never closed is corrected where it was opened.
            mark = error.context_mark or error.problem_mark
        line = mark.line + 1 if mark else None
    for sign, advice in _ADVICE.items():
        if sign in message:
            return Problem(f"not valid YAML: {message} ({advice})", line)
    return Problem(f"not valid YAML: {message}", line)
