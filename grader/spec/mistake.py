"""What pydantic found wrong, in the words of somebody who writes YAML."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel, ValidationError

from grader.spec.document import Place
from grader.spec.nearest_name import did_you_mean, nearest


@dataclass(frozen=True)
class Mistake:
    """One mistake in a document.

    Attributes:
        place: Where; only steps that the document has.
    """

    place: Place
    message: str


@dataclass(frozen=True)
class _Item:
    """An error of pydantic with its place in the document."""

    place: Place
    message: str
    branch: bool = False
    missing: str | None = None
    meant: str | None = None


def mistakes(
    error: ValidationError, model: type[BaseModel], exists: Callable[[Place], bool]
) -> list[Mistake]:
    """Translate a validation error.

    Args:
        exists: Whether the document has a place. (Pydantic also counts the alternatives of a
            union as steps, and keys that are missing.)

    Returns:
        One mistake for each cause: a mistyped key is not reported again as a missing one, and
        the alternatives of a union make one mistake.
    """
    found = [dict(one) for one in error.errors(include_url=False)]
    items = [_item(one, model, exists) for one in found if not _is_echo(one)]
    meant = {(item.place[:-1], item.meant) for item in items if item.meant}
    result: dict[Place, list[str]] = {}
    single: list[Mistake] = []
    for item in items:
        if item.missing is not None and (item.place, item.missing) in meant:
            continue
        if item.branch:
            result.setdefault(item.place, []).append(item.message)
        else:
            single.append(Mistake(item.place, item.message))
    joined = [Mistake(place, "; or ".join(dict.fromkeys(texts))) for place, texts in result.items()]
    return single + joined


def _is_echo(found: dict[str, Any]) -> bool:
    """Whether a list is called too short only because its entries have mistakes."""
    value, context = found.get("input"), found.get("ctx", {})
    return (
        found["type"] == "too_short"
        and isinstance(value, list)
        and len(value) >= context["min_length"]
    )


def _item(found: dict[str, Any], model: type[BaseModel], exists: Callable[[Place], bool]) -> _Item:
    loc: Place = tuple(found["loc"])
    kind = found["type"]
    missing = str(loc[-1]) if kind == "missing" else None
    place: Place = ()
    steps = loc[:-1] if missing is not None else loc
    for step in steps:
        if exists((*place, step)):
            place = (*place, step)
    if missing is not None:
        return _Item(place, f"the key {missing!r} is missing", missing=missing)
    if kind == "extra_forbidden":
        key = str(loc[-1])
        allowed = _keys(model, loc[:-1])
        text = f"unknown key {key!r}." + (
            did_you_mean(key, allowed) or f" Allowed here: {', '.join(sorted(allowed))}."
            if allowed
            else " None are allowed here."
        )
        return _Item(place, text, meant=nearest(key, allowed))
    return _Item(place, _text(kind, found), branch=len(place) < len(loc))


def _text(kind: str, found: dict[str, Any]) -> str:
    value, context = found.get("input"), found.get("ctx", {})
    if kind in _EXPECTED:
        advice = ": write it in quotes" if kind == "string_type" and _is_scalar(value) else ""
        if isinstance(value, str) and _EXPECTED[kind].endswith("number"):
            advice = _number_advice(value)
        return f"expected {_EXPECTED[kind]}, not {_shown(value)}{advice}"
    if kind in ("literal_error", "enum"):
        parts = _alternatives(context["expected"])
        advice = ""
        if isinstance(value, str):
            allowed = [part.strip("'") for part in parts]
            advice = did_you_mean(value, allowed)
            if value in parts:
                return f"expected {value}, not the text {value!r}: write it without quotes"
        return f"expected {context['expected']}, not {_shown(value)}" + (advice and f".{advice}")
    if kind in _BOUNDS:
        word, key = _BOUNDS[kind]
        return f"must be {word} {context[key]:g}, not {_shown(value)}"
    if kind in ("too_short", "too_long"):
        word, key = ("least", "min_length") if kind == "too_short" else ("most", "max_length")
        count = context[key]
        return f"expected at {word} {count} {'entry' if count == 1 else 'entries'}"
    if kind == "union_tag_not_found":
        return f"the key {context['discriminator']} is missing: it tells what this entry is"
    if kind == "union_tag_invalid":
        allowed = [part.strip("'") for part in context["expected_tags"].split(", ")]
        advice = did_you_mean(str(context["tag"]), allowed) or f" Allowed: {', '.join(allowed)}."
        return f"{context['discriminator']} is unknown: {context['tag']!r}.{advice}"
    message = str(found["msg"])
    if kind in ("value_error", "quantity"):
        return message.removeprefix("Value error, ")
    return message[0].lower() + message[1:]


def _number_advice(text: str) -> str:
    """What to write in place of a text that looks like a number."""
    point = text.replace(",", ".")
    try:
        float(point)
    except ValueError:
        return ""
    return f": write {point}" if point != text else ": write it without quotes"


_EXPECTED = {
    **dict.fromkeys(
        ("model_type", "model_attributes_type", "dict_type", "mapping_type"), "keys and values"
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


def _alternatives(expected: str) -> list[str]:
    return expected.replace(" or ", ", ").split(", ")


def _is_scalar(value: object) -> bool:
    return isinstance(value, bool | int | float)


def _shown(value: object) -> str:
    """A value in the words of YAML."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "keys and values"
    if isinstance(value, list):
        return "a list"
    return repr(value)


def _keys(model: type[BaseModel], loc: Place) -> set[str]:
    """Keys that are allowed at a location, as far as the annotations tell."""
    current = [model]
    for step in loc:
        if isinstance(step, int):
            continue
        inner = [found for one in current for found in _models_under(one, step)]
        # Anything else than a field is the tag of a union, or a key of a mapping of models.
        tagged = [one for one in current if step in (one.__name__, *_tags(one))]
        current = inner or tagged or current
    return {field.alias or name for one in current for name, field in one.model_fields.items()}


def _models_under(model: type[BaseModel], key: str) -> list[type[BaseModel]]:
    for name, field in model.model_fields.items():
        if key == (field.alias or name):
            return _models_in(field.annotation)
    return []


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [found for part in get_args(annotation) for found in _models_in(part)]


def _tags(model: type[BaseModel]) -> set[str]:
    return {
        value
        for field in model.model_fields.values()
        if get_origin(field.annotation) is Literal
        for value in get_args(field.annotation)
        if isinstance(value, str)
    }
