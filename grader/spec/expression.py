"""Expressions of fields, such as ``yaw(pose.orientation)`` or ``2 * linear.x``.

They are read as a tree and computed from a short table: nothing of the YAML is executed.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from grader.spec.nearest_name import nearest_or_all
from grader.spec.text_numbers import numbers_in
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


def _number(text: Any) -> float:
    if not isinstance(text, str):
        raise TypeError("number() is of a text")
    return next(iter(numbers_in(text)), math.nan)


def _norm(vector: Any) -> float:
    return math.hypot(*(vector.values() if isinstance(vector, Mapping) else vector))


_FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{"yaw": _of_quaternion(yaw), "roll": _of_quaternion(_roll), "pitch": _of_quaternion(_pitch)},
    **{name: getattr(math, name) for name in ("hypot", "sqrt", "sin", "cos", "tan", "asin")},
    **{name: getattr(math, name) for name in ("acos", "atan", "atan2", "degrees", "radians")},
    **{
        "number": _number,
        "norm": _norm,
        "abs": abs,
        "min": min,
        "max": max,
        "sum": sum,
        "len": len,
    },
}
_ALL_AROUND = ("yaw", "roll", "atan2")
_OPERATORS: dict[type, Callable[..., Any]] = {
    **{ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul},
    **{ast.Div: operator.truediv, ast.USub: operator.neg, ast.UAdd: operator.pos},
}
_LIKE_AN_ANGLE = {ast.Add, ast.Sub, ast.USub, ast.UAdd}


@dataclass(frozen=True)
class Expression:
    """A number (or another value) that follows from the fields of a message.

    It is one field, a quantity such as ``90 deg`` (in SI units), or made of these with
    ``+ - * /``, ``pi`` and the functions of the table.

    Attributes:
        fields: Paths of the fields that it is made of.
        circle: Of an angle that goes all around: a full turn in its unit; else 0.
        value: Computes it; NaN where there is no result, as of a division by zero. A TypeError
            says that a field has another kind of value than the expression needs.
    """

    fields: tuple[str, ...]
    circle: float
    value: Callable[[Find], Any]

    @classmethod
    @cache
    def of(cls, text: str) -> Expression:
        """Read one; a ValueError says what is wrong."""
        if _PATH.fullmatch(text):
            return _field(text)
        try:
            number, _ = parse_any(text)
            return cls((), 0.0, lambda _: number)
        except ValueError as error:
            why = str(error) if "unknown unit" in str(error) else f"{text!r} cannot be read"
        try:
            tree = ast.parse(text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError):
            unclosed = text.count("(") > text.count(")")
            why += ": inside {...} an expression with a comma needs quotes" if unclosed else ""
            raise ValueError(why) from None
        return _read(tree)


def is_field(text: str) -> bool:
    """Whether an expression is just the path of a field."""
    return _PATH.fullmatch(text) is not None


def _field(path: str) -> Expression:
    return Expression((path,), 0.0, lambda find: find(path))


def _path(node: ast.AST) -> str:
    """The path of a field; nothing for anything else."""
    match node:
        case ast.Name(id=name):
            return name
        case ast.Attribute(value=inner, attr=name):
            around = _path(inner)
            return around and f"{around}.{name}"
        case ast.Subscript(value=inner, slice=ast.Constant(value=int(index))):
            around = _path(inner)
            return around and f"{around}[{index}]"
    return ""


def _read(node: ast.expr) -> Expression:
    path, name = _path(node), ""
    sign: ast.AST = node
    if path and path != "pi":
        return _field(path)
    parts: list[ast.expr] = []
    match node:
        case ast.Name():
            return Expression((), 0.0, lambda _: math.pi)
        case ast.Constant(value=number) if type(number) in (int, float):
            return Expression((), 0.0, lambda _: number)
        case ast.Call(func=ast.Name(id=name), args=parts, keywords=[]):
            if name not in _FUNCTIONS:
                advice = nearest_or_all(name, _FUNCTIONS, "The functions are")
                raise ValueError(f"there is no function {name!r}.{advice}")
        case ast.BinOp(left=left, op=sign, right=right):
            parts = [left, right]
        case ast.UnaryOp(op=sign, operand=operand):
            parts = [operand]
    function = _FUNCTIONS.get(name) or _OPERATORS.get(type(sign))
    if function is None:
        raise ValueError(f"{ast.unparse(node)!r} is not allowed in it")
    read = [_read(part) for part in parts]

    def value(find: Find) -> Any:
        values = [part.value(find) for part in read]
        try:
            return function(*values)
        except (ArithmeticError, ValueError):
            return math.nan

    circle = math.tau if name in _ALL_AROUND else 0.0
    if name in ("degrees", "radians") or type(sign) in _LIKE_AN_ANGLE:
        circle = max((part.circle for part in read), default=0.0)
        circle = function(circle) if name else circle
    return Expression(tuple(dict.fromkeys(f for part in read for f in part.fields)), circle, value)
