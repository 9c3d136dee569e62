"""From a message as an author writes it to plain values of its fields, each checked."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from grader.recording.interface import FLOATS, INTEGERS, TEXTS, Field, fields_of
from grader.spec.document import Place, path
from grader.spec.nearest_name import did_you_mean
from grader.spec.unit import parse_any

NOW = "now"
"""In a field for a time: the time at which the message is published."""

_TIME = "builtin_interfaces/msg/Time"
_PATH = re.compile(r"[A-Za-z]\w*(?:\[\d{1,6}\])*(?:\.[A-Za-z]\w*(?:\[\d{1,6}\])*)*")
_STEP = re.compile(r"[A-Za-z]\w*|\[\d+\]")
_PARTS = re.compile(r"^---\s*$", re.MULTILINE)

Find = Callable[[str], str]
"""Function from an interface name to the text of its ``.msg`` file; KeyError without one."""


class StimulusError(ValueError):
    """A value in a stimulus does not fit.

    Attributes:
        place: Of the value, below the stimulus in the YAML.
    """

    def __init__(self, text: str, place: Place) -> None:
        """Keep the place."""
        self.place = place
        super().__init__(text)


def part_of(find: Find, interface: str, number: int) -> Find:
    """A finder that returns only a part of one interface: 0 is the request, or the goal."""
    text = _PARTS.split(find(interface))[number]
    return lambda name: text if name == interface else find(name)


def read_message(
    value: Mapping[str, Any],
    interface: str,
    find: Find,
    drawn: Mapping[str, float],
    place: Place = (),
) -> dict[str, Any]:
    """Read a message; a KeyError names a definition that is missing.

    Args:
        value: Fields by name, nested or by path (``linear.x``, ``data[0]``).
        drawn: Values of the scenario by name, which ``$name`` stands for.
        place: Of the value, for errors.
    """
    message = _Reader(find, drawn, place).message(value, interface, ())
    assert isinstance(message, dict)
    return message


def _nested(value: Mapping[str, Any]) -> dict[str, Any]:
    """Turn paths into nested fields: ``{"data[0]": 1, "data[1]": 2}`` is ``{"data": [1, 2]}``."""
    root = _Inner()
    for key, item in value.items():
        if not _PATH.fullmatch(str(key)):
            raise ValueError(f"{key!r} is not a field: write its path, as in linear.x or data[0]")
        *steps, last = _STEP.findall(str(key))
        inner: Any = root
        for step in steps:
            inner = inner.setdefault(step, _Inner())
            if not isinstance(inner, _Inner):
                raise ValueError(f"{key!r} is given twice")
        if last in inner:
            raise ValueError(f"{key!r} is given twice")
        inner[last] = item
    return {name: _plain(item, name) for name, item in root.items()}


class _Inner(dict[str, Any]):
    """A dict of fields or items made from paths, unlike a mapping that an author wrote."""


def _plain(value: Any, where: str) -> Any:
    if not isinstance(value, _Inner):
        return value
    if not any(key.startswith("[") for key in value):
        return {key: _plain(item, f"{where}.{key}") for key, item in value.items()}
    indices = [f"[{index}]" for index in range(len(value))]
    for index in indices:
        if index not in value:
            raise ValueError(f"{where}{index} is missing: give the items from [0] on")
    return [_plain(value[index], where + index) for index in indices]


@dataclass(frozen=True)
class _Reader:
    find: Find
    drawn: Mapping[str, float]
    base: Place

    def message(self, value: Any, interface: str, place: Place) -> dict[str, Any] | str:
        if interface == _TIME and value == NOW:
            return NOW
        where = f"{path(place) or 'the message'} ({interface})"
        if not isinstance(value, Mapping):
            raise StimulusError(f"{where}: expected its fields", (*self.base, *place))
        fields = fields_of(interface, self.find(interface))
        try:
            items = _nested(value)
        except ValueError as error:
            raise StimulusError(str(error), (*self.base, *place)) from None
        message = {}
        for name, item in items.items():
            if name not in fields:
                listed = f" It has: {', '.join(fields) or 'none'}."
                text = f"{where} has no field {name!r}.{did_you_mean(name, fields) or listed}"
                raise StimulusError(text, (*self.base, *place, name))
            message[name] = self._field(item, fields[name], (*place, name))
        return message

    def _field(self, value: Any, field: Field, place: Place) -> Any:
        if not field.is_array:
            return self._item(value, field, place)
        if not isinstance(value, Sequence) or isinstance(value, str):
            raise self._misfit(place, "a list", value)
        if field.count is not None and len(value) != field.count:
            raise self._misfit(place, f"{field.count} values", len(value))
        if field.most is not None and len(value) > field.most:
            raise self._misfit(place, f"at most {field.most} values", len(value))
        return [self._item(item, field, (*place, index)) for index, item in enumerate(value)]

    def _item(self, value: Any, field: Field, place: Place) -> Any:
        if field.is_message:
            return self.message(value, field.type, place)
        if field.type in TEXTS:
            if not isinstance(value, str):
                raise self._misfit(place, "text", value)
            return value
        if field.type == "bool":
            word = str(value).lower()
            if not isinstance(value, bool | str) or word not in ("true", "false"):
                raise self._misfit(place, "true or false", value)
            return word == "true"
        return self._number(value, field.type, place)

    def _number(self, value: Any, kind: str, place: Place) -> int | float:
        number = self._read(value, place) if isinstance(value, str) else value
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise self._misfit(place, "a number", value)
        if kind in FLOATS:
            return float(number)
        low, high = INTEGERS[kind]
        if not math.isfinite(number) or number != int(number) or not low <= number <= high:
            raise self._misfit(place, f"a whole number from {low} to {high} ({kind})", value)
        return int(number)

    def _read(self, text: str, place: Place) -> float | int | None:
        """The number that a text stands for: ``$name``, ``30 deg`` or ``1e3``; None for none."""
        if text.startswith("$"):
            name = text[1:]
            if name not in self.drawn:
                advice = did_you_mean(name, self.drawn)
                message = f"{path(place)}: there is no value {name!r}.{advice}"
                raise StimulusError(message, (*self.base, *place))
            return self.drawn[name]
        # A whole number of 64 bits does not survive as a float.
        for read in (int, lambda quantity: parse_any(quantity)[0], float):
            try:
                return read(text)
            except ValueError:
                continue
        return None

    def _misfit(self, place: Place, expected: str, value: Any) -> StimulusError:
        text = f"{path(place)}: expected {expected}, not {value!r}"
        return StimulusError(text, (*self.base, *place))
