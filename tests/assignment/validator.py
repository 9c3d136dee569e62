"""A small JSON Schema validator (draft 2020-12): the keywords that our schemas use, no others."""

from __future__ import annotations

import re
from typing import Any

_TYPES: dict[str, tuple[type, ...]] = {
    "object": (dict,),
    "array": (list,),
    "string": (str,),
    "integer": (int,),
    "number": (int, float),
    "boolean": (bool,),
    "null": (type(None),),
}
_WORDS = {"$schema", "$defs", "title", "description", "default", "x-dimension", "x-words"}


def valid(value: Any, schema: Any, root: dict[str, Any]) -> bool:
    """Whether a value fits a schema.

    Raises:
        KeyError: The schema has a keyword that this validator does not know.
    """
    if isinstance(schema, bool):
        return schema
    return all(
        _KEYWORDS[keyword](value, argument, schema, root)
        for keyword, argument in schema.items()
        if keyword not in _WORDS
    )


def _reference(value: Any, argument: str, schema: Any, root: dict[str, Any]) -> bool:
    target: Any = root
    for step in argument.removeprefix("#/").split("/"):
        target = target[step]
    return valid(value, target, root)


def _type(value: Any, argument: str, schema: Any, root: Any) -> bool:
    if isinstance(value, bool):
        return argument == "boolean"
    return isinstance(value, _TYPES[argument])


def _properties(value: Any, argument: dict[str, Any], schema: Any, root: Any) -> bool:
    return not isinstance(value, dict) or all(
        valid(value[key], inner, root) for key, inner in argument.items() if key in value
    )


def _additional(value: Any, argument: Any, schema: Any, root: Any) -> bool:
    return not isinstance(value, dict) or all(
        valid(inner, argument, root)
        for key, inner in value.items()
        if key not in schema.get("properties", {})
    )


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


_KEYWORDS: dict[str, Any] = {
    "$ref": _reference,
    "type": _type,
    "properties": _properties,
    "additionalProperties": _additional,
    "const": lambda v, a, s, r: v == a and isinstance(v, bool) == isinstance(a, bool),
    "enum": lambda v, a, s, r: v in a,
    "required": lambda v, a, s, r: not isinstance(v, dict) or all(key in v for key in a),
    "items": lambda v, a, s, r: not isinstance(v, list) or all(valid(i, a, r) for i in v),
    "minItems": lambda v, a, s, r: not isinstance(v, list) or len(v) >= a,
    "minLength": lambda v, a, s, r: not isinstance(v, str) or len(v) >= a,
    "minProperties": lambda v, a, s, r: not isinstance(v, dict) or len(v) >= a,
    "pattern": lambda v, a, s, r: not isinstance(v, str) or bool(re.search(a, v)),
    "minimum": lambda v, a, s, r: not _number(v) or v >= a,
    "maximum": lambda v, a, s, r: not _number(v) or v <= a,
    "exclusiveMinimum": lambda v, a, s, r: not _number(v) or v > a,
    "exclusiveMaximum": lambda v, a, s, r: not _number(v) or v < a,
    "anyOf": lambda v, a, s, r: any(valid(v, one, r) for one in a),
    "oneOf": lambda v, a, s, r: sum(valid(v, one, r) for one in a) == 1,
    "allOf": lambda v, a, s, r: all(valid(v, one, r) for one in a),
    "if": lambda v, a, s, r: valid(v, s.get("then" if valid(v, a, r) else "else", True), r),
    "then": lambda v, a, s, r: True,
    "else": lambda v, a, s, r: True,
}
