"""Expressions of fields, such as ``yaw(pose.orientation)`` or ``2 * linear.x``.

They are read as a tree and computed from a short table: nothing of the YAML is executed.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
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
            if text.count("(") > text.count(")"):
                why += ": inside {...} an expression with a comma needs quotes"
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
            outer = _path(inner)
            return f"{outer}.{name}" if outer else ""
        case ast.Subscript(value=inner, slice=ast.Constant(value=int(index))):
            outer = _path(inner)
            return f"{outer}[{index}]" if outer else ""
    return ""


def _read(node: ast.expr) -> Expression:
    path = _path(node)
    if path == "pi":
        return Expression((), 0.0, lambda _: math.pi)
    if path:
        return _field(path)
    match node:
        case ast.Constant(value=number) if type(number) in (int, float):
            return Expression((), 0.0, lambda _: number)
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            if name not in _FUNCTIONS:
                advice = nearest_or_all(name, _FUNCTIONS, "The functions are")
                raise ValueError(f"there is no function {name!r}.{advice}")
            return _called(name, [_read(argument) for argument in arguments])
        case ast.BinOp(left=left, op=sign, right=right) if type(sign) in _OPERATORS:
            operands = [_read(left), _read(right)]
            return _computed(_OPERATORS[type(sign)], operands, _circle(sign, operands))
        case ast.UnaryOp(op=sign, operand=inner) if type(sign) in _OPERATORS:
            operand = _read(inner)
            return _computed(_OPERATORS[type(sign)], [operand], _circle(sign, [operand]))
    raise ValueError(f"{ast.unparse(node)!r} is not allowed in it")


def _circle(sign: ast.AST, operands: Sequence[Expression]) -> float:
    """The full turn of a sum or difference of angles; a product of an angle is none."""
    if type(sign) not in _LIKE_AN_ANGLE:
        return 0.0
    return max(operand.circle for operand in operands)


def _called(name: str, arguments: Sequence[Expression]) -> Expression:
    function, circle = _FUNCTIONS[name], 0.0
    if name in _ALL_AROUND:
        circle = math.tau
    elif name in ("degrees", "radians"):
        circle = function(max((argument.circle for argument in arguments), default=0.0))
    return _computed(function, arguments, circle)


def _computed(
    function: Callable[..., Any], parts: Sequence[Expression], circle: float
) -> Expression:
    def value(find: Find) -> Any:
        values = [part.value(find) for part in parts]
        try:
            return function(*values)
        except (ArithmeticError, ValueError):
            return math.nan

    fields = dict.fromkeys(field for part in parts for field in part.fields)
    return Expression(tuple(fields), circle, value)
