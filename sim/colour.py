"""Colours in YAML: a name of CSS such as ``red``, or ``[r, g, b]`` from 0 to 255."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import PlainValidator, WithJsonSchema

from grader.spec.nearest_name import nearest_or_all
from grader.spec.quantity import refusal

Rgb = tuple[int, int, int]

NAMED: dict[str, Rgb] = {
    "black": (0, 0, 0),
    "gray": (128, 128, 128),
    "grey": (128, 128, 128),
    "silver": (192, 192, 192),
    "lightgray": (211, 211, 211),
    "lightgrey": (211, 211, 211),
    "white": (255, 255, 255),
    "red": (255, 0, 0),
    "maroon": (128, 0, 0),
    "brown": (165, 42, 42),
    "orange": (255, 165, 0),
    "yellow": (255, 255, 0),
    "olive": (128, 128, 0),
    "lime": (0, 255, 0),
    "green": (0, 128, 0),
    "teal": (0, 128, 128),
    "cyan": (0, 255, 255),
    "blue": (0, 0, 255),
    "navy": (0, 0, 128),
    "purple": (128, 0, 128),
    "magenta": (255, 0, 255),
    "pink": (255, 192, 203),
}
"""Colours by the names that CSS gives them: https://www.w3.org/TR/css-color-4/#named-colors."""


def _colour(value: Any) -> Rgb:
    if isinstance(value, str):
        if value not in NAMED:
            raise refusal(f"there is no colour {value!r}.{nearest_or_all(value, NAMED)}")
        return NAMED[value]
    if isinstance(value, list | tuple) and len(value) == 3 and all(map(_is_share, value)):
        return value[0], value[1], value[2]
    raise refusal(f"expected a name such as 'red' or [r, g, b] from 0 to 255, not {value!r}")


def _is_share(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= 255


Colour = Annotated[
    Rgb,
    PlainValidator(_colour),
    WithJsonSchema(
        {
            "anyOf": [
                {"enum": list(NAMED)},
                {
                    "type": "array",
                    "items": {"type": "integer", "minimum": 0, "maximum": 255},
                    "minItems": 3,
                    "maxItems": 3,
                },
            ],
            "description": "A name of CSS, or [r, g, b] from 0 to 255.",
            "x-words": "colour, such as `red` or `[255, 165, 0]`",
        }
    ),
]
