"""What pydantic found wrong, in the words of a person who writes YAML."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from grader.spec.document import Place
from grader.spec.nearest_name import did_you_mean, nearest, nearest_or_all


def mistakes(
    error: ValidationError, model: type[BaseModel], exists: Callable[[Place], bool]
) -> list[tuple[Place, str]]:
    """Translate a validation error.

    Args:
        exists: Whether the document has a place. (Pydantic also counts the alternatives of a
            union as steps, and keys that are missing.)

    Returns:
        Place in the document and text, one for each cause: a mistyped key is not reported again
        as a missing one, and the alternatives of a union make one mistake.
    """
    unknown: list[tuple[Place, str]] = []
    missing: list[tuple[Place, str]] = []
    meant_keys: set[tuple[Place, str | None]] = set()
    wrong: dict[Place, list[str]] = {}
    details: list[Any] = error.errors(include_url=False)
    for detail in details:
        place: Place = ()
        for step in detail["loc"]:
            if exists((*place, step)):
                place = (*place, step)
        key = str(detail["loc"][-1]) if detail["loc"] else ""
        if detail["type"] == "missing":
            missing.append((place, key))
        elif detail["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
            allowed = _keys(model, detail["loc"][:-1])
            meant_keys.add((place[:-1], nearest(key, allowed)))
            advice = nearest_or_all(key, sorted(allowed), "Allowed here")
            unknown.append((place, f"unknown key {key!r}.{advice}"))
        elif not _is_echo(detail):
            wrong.setdefault(place, []).append(_text(detail))
    # What is wrong inside a value is told, so its form is meant: not another one of a union.
    told = [*(place for place, _ in unknown), *((*place, key) for place, key in missing), *wrong]
    meant_forms = {place[:end] for place in told for end in range(len(place))}
    found = unknown
    for place, key in missing:
        if (place, key) not in meant_keys:
            found.append((place, f"the key {key!r} is missing"))
    for place, texts in wrong.items():
        if place not in meant_forms:
            found.append((place, "; or ".join(dict.fromkeys(texts))))
    return found


def _is_echo(detail: dict[str, Any]) -> bool:
    """Whether a list is called too short only because its entries have mistakes."""
    value = detail["input"]
    if detail["type"] != "too_short" or not isinstance(value, list | tuple):
        return False
    return len(value) >= int(detail["ctx"]["min_length"])


def _text(detail: dict[str, Any]) -> str:
    """One detail of pydantic's in words."""
    kind, value, context = detail["type"], detail["input"], detail.get("ctx", {})
    if kind in _EXPECTED:
        return f"expected {_EXPECTED[kind]}, not {_shown(value)}{_quotes(kind, value)}"
    if kind in ("literal_error", "enum"):
        words = context["expected"]
        allowed = [part.strip("'") for part in words.replace(" or ", ", ").split(", ")]
        advice = did_you_mean(value, allowed) if isinstance(value, str) else ""
        return f"expected {words}, not {_shown(value)}{'.' if advice else ''}{advice}"
    if kind in _BOUNDS:
        word, key = _BOUNDS[kind]
        return f"must be {word} {context[key]:g}, not {_shown(value)}"
    if kind in ("too_short", "too_long"):
        word, key = ("least", "min_length") if kind == "too_short" else ("most", "max_length")
        count = context[key]
        return f"expected at {word} {count} {'entry' if count == 1 else 'entries'}"
    message = str(detail["msg"])
    if kind in ("value_error", "quantity"):
        return message.removeprefix("Value error, ")
    return message[0].lower() + message[1:]


def _quotes(kind: str, value: object) -> str:
    """Advice on quotes, where they are what makes a value one of the wrong type."""
    if kind == "string_type" and isinstance(value, bool | int | float):
        return ": write it in quotes"
    with suppress(ValueError):
        if isinstance(value, str) and _EXPECTED[kind].endswith("number") and float(value):
            return ": write it without quotes"
    return ""


_EXPECTED = {
    **dict.fromkeys(
        ("model_type", "model_attributes_type", "dataclass_type", "dict_type", "mapping_type"),
        "keys and values",
    ),
    **dict.fromkeys(("list_type", "tuple_type", "set_type"), "a list"),
    "string_type": "text",
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float"), "a whole number"),
    **dict.fromkeys(("float_type", "float_parsing"), "a number"),
    **dict.fromkeys(("bool_type", "bool_parsing"), "true or false"),
    "finite_number": "a finite number",
    "none_required": "nothing",
}
_BOUNDS = {
    "greater_than": ("more than", "gt"),
    "greater_than_equal": ("at least", "ge"),
    "less_than": ("less than", "lt"),
    "less_than_equal": ("at most", "le"),
}


def _shown(value: object) -> str:
    """A value as YAML writes it."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict | list):
        return "a list" if isinstance(value, list) else "keys and values"
    return repr(value)


def _keys(model: type[BaseModel], loc: Place) -> set[str]:
    """Keys that are allowed at a location, as far as the annotations tell."""
    models: list[type[Any]] = [model]
    for step in loc:
        if isinstance(step, int):
            continue
        inner = [
            nested
            for outer in models
            for name, field in outer.__pydantic_fields__.items()
            if step == (field.alias or name)
            for nested in _models_in(field.annotation)
        ]
        # Anything else than a field is the tag of a union, or a key of a mapping of models.
        tagged = [outer for outer in models if step == outer.__name__]
        models = inner or tagged or models
    return {
        field.alias or name
        for nested in models
        for name, field in nested.__pydantic_fields__.items()
    }


def _models_in(annotation: Any) -> list[type[Any]]:
    if isinstance(annotation, type) and hasattr(annotation, "__pydantic_fields__"):
        return [annotation]
    return [model for part in get_args(annotation) for model in _models_in(part)]
