"""Expressions of fields, such as ``yaw(pose.orientation)`` or ``2 * linear.x``.

They are read as a tree and computed from a short table: nothing of the YAML is executed.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from grader.spec.nearest_name import nearest_or_all
from grader.spec.unit import parse_any

Find = Callable[[str], Any]
"""Looks up what is in a field, by its path."""

_NAME = r"[A-Za-z][A-Za-z0-9_]*(?:\[[0-9]{1,9}\])*"
_PATH = re.compile(rf"{_NAME}(?:\.{_NAME})*")


def yaw(x: float, y: float, z: float, w: float) -> float:
    """Heading of a quaternion: its rotation about the fixed z axis, in [-pi, pi].

    Source: REP-103, and the usual conversion to roll, pitch, yaw.
    """
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _roll(x: float, y: float, z: float, w: float) -> float:
    return math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))


def _pitch(x: float, y: float, z: float, w: float) -> float:
    return math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))


def _of_quaternion(angle: Callable[..., float]) -> Callable[[Any], float]:
    def computed(value: Any) -> float:
        if not isinstance(value, Mapping) or not set("xyzw") <= set(value):
            raise TypeError("a quaternion has x, y, z and w")
        return angle(*(value[part] for part in "xyzw"))

    return computed


def _norm(vector: Any) -> float:
    return math.hypot(*(vector.values() if isinstance(vector, Mapping) else vector))


_FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{"yaw": _of_quaternion(yaw), "roll": _of_quaternion(_roll), "pitch": _of_quaternion(_pitch)},
    **{name: getattr(math, name) for name in ("hypot", "sqrt", "sin", "cos", "tan", "asin")},
    **{name: getattr(math, name) for name in ("acos", "atan", "atan2", "degrees", "radians")},
    **{"norm": _norm, "abs": abs, "min": min, "max": max, "sum": sum, "len": len},
}
_ALL_AROUND = ("yaw", "roll", "atan2")
_OPERATORS: dict[type, Callable[..., Any]] = {
    **{ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul},
    **{ast.Div: operator.truediv, ast.USub: operator.neg, ast.UAdd: operator.pos},
}


@dataclass(frozen=True)
class Expression:
    """A number (or another value) that follows from the fields of a message.

    It may be one field, a quantity such as ``90 deg`` (in SI units), or made of these with
    ``+ - * /``, ``pi`` and the functions of the table.
    """

    text: str
    _tree: ast.expr = field(compare=False, repr=False)

    @classmethod
    @cache
    def of(cls, text: str) -> Expression:
        """Read one; a ValueError says what is wrong."""
        if _PATH.fullmatch(text):
            return cls(text, ast.Name(text))
        try:
            return cls(text, ast.Constant(parse_any(text)[0]))
        except ValueError as error:
            why = str(error) if "unknown unit" in str(error) else f"{text!r} cannot be read"
        try:
            tree = ast.parse(text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError):
            unclosed = text.count("(") > text.count(")")
            why += ": inside {...} an expression with a comma needs quotes" if unclosed else ""
            raise ValueError(why) from None
        _examine(tree, text.strip())
        return cls(text, tree)

    @property
    def is_field(self) -> bool:
        """Whether it is just one field."""
        return isinstance(self._tree, ast.Name)

    @property
    def fields(self) -> tuple[str, ...]:
        """Paths of the fields that it is made of."""
        return tuple(dict.fromkeys(_fields(self._tree)))

    @property
    def circle(self) -> float:
        """Of an angle that goes all around: a full turn in its unit; else 0."""
        return _circle(self._tree)

    def value(self, find: Find) -> Any:
        """Compute it; NaN where there is no result, as of a division by zero.

        Raises:
            TypeError: A field has another kind of value than the expression needs.
        """
        return _value(self._tree, find)


def _path(node: ast.AST) -> str:
    """The path of a field; nothing for anything else."""
    match node:
        case ast.Name(id=name):
            return name
        case ast.Attribute(value=inner, attr=name):
            around = _path(inner)
            return around and f"{around}.{name}"
        case ast.Subscript(value=inner, slice=ast.Constant(value=int(index))) if index >= 0:
            around = _path(inner)
            return around and f"{around}[{index}]"
    return ""


def _parts(node: ast.AST) -> list[ast.expr]:
    """What an expression is made of."""
    match node:
        case ast.Call(args=arguments, keywords=[]):
            return arguments
        case ast.BinOp(left=left, right=right):
            return [left, right]
        case ast.UnaryOp(operand=operand):
            return [operand]
    return []


def _examine(node: ast.expr, text: str) -> None:
    """Refuse what is not in the table."""
    match node:
        case _ if _path(node):
            return
        case ast.Constant(value=number) if type(number) in (int, float):
            return
        case ast.Call(func=ast.Name(id=name), keywords=[]):
            if name not in _FUNCTIONS:
                advice = nearest_or_all(name, _FUNCTIONS, "The functions are")
                raise ValueError(f"there is no function {name!r}.{advice}")
        case ast.BinOp(op=sign) | ast.UnaryOp(op=sign) if type(sign) in _OPERATORS:
            pass
        case _:
            raise ValueError(f"{ast.get_source_segment(text, node)!r} is not allowed in it")
    for part in _parts(node):
        _examine(part, text)


def _fields(node: ast.AST) -> Iterator[str]:
    path = _path(node)
    if path and path != "pi":
        yield path
    for part in () if path else _parts(node):
        yield from _fields(part)


def _circle(node: ast.AST) -> float:
    match node:
        case ast.Call(func=ast.Name(id=name)) if name in _ALL_AROUND:
            return math.tau
        case ast.Call(func=ast.Name(id="degrees"), args=[inner]):
            return math.degrees(_circle(inner))
        case ast.Call(func=ast.Name(id="radians"), args=[inner]):
            return math.radians(_circle(inner))
        case ast.UnaryOp() | ast.BinOp(op=ast.Add() | ast.Sub()):
            return max(map(_circle, _parts(node)))
    return 0.0


def _value(node: ast.AST, find: Find) -> Any:
    path = _path(node)
    if path:
        return math.pi if path == "pi" else find(path)
    if isinstance(node, ast.Constant):
        return node.value
    values = [_value(part, find) for part in _parts(node)]
    if isinstance(node, ast.Call):
        function = _FUNCTIONS[getattr(node.func, "id", "")]
    else:
        function = _OPERATORS[type(getattr(node, "op", None))]
    try:
        return function(*values)
    except (ArithmeticError, ValueError):
        return math.nan
