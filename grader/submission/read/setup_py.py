"""What setup.py passes to ``setup()``, read from its syntax tree without running it.

Covers what students and ``ros2 pkg create`` write: literals, names assigned once at the top,
f-strings, ``+``, ``%`` and ``.format``. What needs running stays unknown.
"""

from __future__ import annotations

import ast
import contextlib
import re
import string
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Union

_MAX_DEPTH = 50
_MAX_STEPS = 20_000
_MAX_TEXT = 10_000
_PERCENT = re.compile(r"%(.)", re.DOTALL)


class Unknown(Exception):
    """An expression whose value cannot be told without running it."""


@dataclass(frozen=True)
class Text:
    """A string and the line where it stands."""

    value: str
    line: int


Value = Union[Text, "list[Value]", "dict[str, Value]"]


def setup_keywords(tree: ast.Module) -> dict[str, Value]:
    """Evaluate the keyword arguments of the first call of ``setup``.

    Returns:
        The keywords whose values can be told: strings, lists (also for tuples) and
        dictionaries with string keys. Items of a list that cannot be told are left out.
    """
    evaluator = _Evaluator(_assigned(tree))
    call = next((node for node in ast.walk(tree) if _is_setup(node)), None)
    found: dict[str, Value] = {}
    if not isinstance(call, ast.Call):
        return found
    for keyword in call.keywords:
        try:
            value = evaluator.value(keyword.value)
        except Unknown:
            continue
        if keyword.arg is not None:
            found[keyword.arg] = value
        elif isinstance(value, dict):
            found.update(value)
    return found


def _is_setup(node: ast.AST) -> bool:
    if not isinstance(node, ast.Call):
        return False
    function = node.func
    name = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
    return name == "setup"


def _assigned(tree: ast.Module) -> dict[str, ast.expr]:
    """Names that the top level assigns exactly once."""
    names: dict[str, ast.expr] = {}
    again: set[str] = set()
    for node in tree.body:
        targets: list[ast.expr] = []
        if isinstance(node, ast.Assign):
            targets, value = node.targets, node.value
        elif isinstance(node, ast.AnnAssign) and node.value is not None:
            targets, value = [node.target], node.value
        for target in targets:
            if isinstance(target, ast.Name):
                if target.id in names:
                    again.add(target.id)
                names[target.id] = value
    return {name: value for name, value in names.items() if name not in again}


class _Evaluator:
    """Evaluates expressions, with a budget: nested names could double at every level."""

    def __init__(self, names: Mapping[str, ast.expr]) -> None:
        self._names = names
        self._steps = 0

    def value(self, node: ast.expr, depth: int = 0) -> Value:
        """Evaluate an expression.

        Raises:
            Unknown: It would have to be run.
        """
        self._steps += 1
        if depth > _MAX_DEPTH or self._steps > _MAX_STEPS:
            raise Unknown
        below = depth + 1
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            return Text(node.value, node.lineno)
        if isinstance(node, ast.Name) and node.id in self._names:
            value = self.value(self._names[node.id], below)
            return Text(value.value, node.lineno) if isinstance(value, Text) else value
        if isinstance(node, (ast.List, ast.Tuple)):
            return self._items(node.elts, below)
        if isinstance(node, ast.Dict):
            return self._dictionary(node, below)
        if isinstance(node, ast.JoinedStr):
            return _joined([self._text(part, below) for part in node.values], node)
        if isinstance(node, ast.FormattedValue) and node.format_spec is None:
            return _joined([self._text(node.value, below)], node)
        if isinstance(node, ast.BinOp):
            return self._operation(node, below)
        if isinstance(node, ast.Call):
            return self._call(node, below)
        raise Unknown

    def _text(self, node: ast.expr, depth: int) -> str:
        value = self.value(node, depth)
        if not isinstance(value, Text):
            raise Unknown
        return value.value

    def _items(self, nodes: list[ast.expr], depth: int) -> list[Value]:
        items: list[Value] = []
        for node in nodes:
            with contextlib.suppress(Unknown):
                items.append(self.value(node, depth))
        return items

    def _dictionary(self, node: ast.Dict, depth: int) -> dict[str, Value]:
        result: dict[str, Value] = {}
        for key, item in zip(node.keys, node.values, strict=True):
            with contextlib.suppress(Unknown):
                value = self.value(item, depth)
                if key is not None:
                    result[self._text(key, depth)] = value
                elif isinstance(value, dict):
                    result.update(value)
        return result

    def _operation(self, node: ast.BinOp, depth: int) -> Value:
        left = self.value(node.left, depth)
        if isinstance(node.op, ast.Mod) and isinstance(left, Text):
            right = node.right.elts if isinstance(node.right, ast.Tuple) else [node.right]
            values = [self._text(part, depth) for part in right]
            return _joined(_percent(left.value, values), node)
        if isinstance(node.op, ast.Add):
            right_value = self.value(node.right, depth)
            if isinstance(left, Text) and isinstance(right_value, Text):
                return _joined([left.value, right_value.value], node)
            if isinstance(left, list) and isinstance(right_value, list):
                return [*left, *right_value]
        raise Unknown

    def _call(self, node: ast.Call, depth: int) -> Value:
        function = node.func
        if isinstance(function, ast.Attribute) and function.attr == "format":
            template = self._text(function.value, depth)
            values = [self._text(argument, depth) for argument in node.args]
            named = {
                keyword.arg: self._text(keyword.value, depth)
                for keyword in node.keywords
                if keyword.arg is not None
            }
            return _joined(_braces(template, values, named), node)
        if isinstance(function, ast.Name) and function.id == "dict" and not node.args:
            return {
                keyword.arg: self.value(keyword.value, depth)
                for keyword in node.keywords
                if keyword.arg is not None
            }
        raise Unknown


def _joined(parts: list[str], node: ast.expr) -> Text:
    if sum(map(len, parts)) > _MAX_TEXT:
        raise Unknown
    return Text("".join(parts), node.lineno)


def _percent(template: str, values: list[str]) -> list[str]:
    """Split ``"a %s"`` with its values filled in; widths and the like stay unknown."""
    pieces = _PERCENT.split(template)
    ahead = iter(values)
    for place in range(1, len(pieces), 2):
        if pieces[place] == "s":
            filled = next(ahead, None)
            if filled is None:
                raise Unknown
            pieces[place] = filled
        elif pieces[place] != "%":
            raise Unknown
    return pieces


def _braces(template: str, values: list[str], named: Mapping[str, str]) -> list[str]:
    """Split ``"a {}"`` with its values filled in; formats and the like stay unknown."""
    pieces: list[str] = []
    place = 0
    try:
        for literal, name, spec, conversion in string.Formatter().parse(template):
            pieces.append(literal)
            if name is None:
                continue
            if spec or conversion:
                raise Unknown
            if name == "":
                pieces.append(values[place])
                place += 1
            else:
                pieces.append(values[int(name)] if name.isdecimal() else named[name])
    except (ValueError, LookupError) as error:
        raise Unknown from error
    return pieces
