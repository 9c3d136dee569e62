"""A message as an author writes it, into plain values of its fields, checked one by one."""

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
"""Stands for the time at which a message is published, in a field of that type."""

_TIME = "builtin_interfaces/msg/Time"
_FLOAT32_MAX = 3.4028234663852886e38
_PATH = re.compile(r"[A-Za-z]\w*(?:\[\d{1,6}\])*(?:\.[A-Za-z]\w*(?:\[\d{1,6}\])*)*")
_STEP = re.compile(r"[A-Za-z]\w*|\[\d+\]")

Find = Callable[[str], str]
"""From an interface name to the text of its ``.msg`` file; KeyError where there is none."""


class MessageError(ValueError):
    """A value does not fit the message."""

    def __init__(self, text: str, place: Place = ()) -> None:
        """Keep where it is."""
        self.place = place
        super().__init__(text)


class UnknownField(MessageError):
    """The message has no such field."""


def read_message(
    value: Mapping[str, Any], interface: str, find: Find, drawn: Mapping[str, float]
) -> dict[str, Any]:
    """Read a message.

    Args:
        value: Fields by name, nested or by path (``linear.x``, ``data[0]``).

    Raises:
        MessageError: A field does not exist, or its value does not fit.
        KeyError: A definition is missing.
    """
    found = _Reader(find, drawn).message(value, interface, ())
    assert isinstance(found, dict)
    return found


def nested(value: Mapping[str, Any]) -> dict[str, Any]:
    """Turn paths into nested fields: ``{"data[0]": 1, "data[1]": 2}`` is ``{"data": [1, 2]}``.

    Raises:
        MessageError: A key is no path, stands twice, or leaves out an item of an array.
    """
    root: dict[Any, Any] = {}
    for key, item in value.items():
        if not _PATH.fullmatch(str(key)):
            raise MessageError(f"{key!r} is no field: write its path, as in linear.x or data[0]")
        here = root
        steps = _STEP.findall(str(key))
        for step, following in zip(steps, [*steps[1:], None], strict=True):
            name: Any = int(step[1:-1]) if step.startswith("[") else step
            if following is None:
                if name in here:
                    raise MessageError(f"{key!r} is given twice")
                here[name] = item
                continue
            inner = here.setdefault(name, _Inner())
            if not isinstance(inner, _Inner):
                raise MessageError(f"{key!r} is given twice")
            here = inner
    return {name: _plain(item, name) for name, item in root.items()}


class _Inner(dict[Any, Any]):
    """Fields or items that come from paths; what an author wrote as a mapping is none."""


def _plain(value: Any, where: str) -> Any:
    if not isinstance(value, _Inner):
        return value
    if all(isinstance(key, str) for key in value):
        return {key: _plain(item, f"{where}.{key}") for key, item in value.items()}
    indices = sorted(key for key in value if isinstance(key, int))
    if len(indices) < len(value):
        raise MessageError(f"{where} is given items and fields")
    for number, index in enumerate(indices):
        if number != index:
            raise MessageError(f"{where}[{number}] is missing before {where}[{index}]")
    return [_plain(value[index], f"{where}[{index}]") for index in indices]


@dataclass(frozen=True)
class _Reader:
    find: Find
    drawn: Mapping[str, float]

    def message(self, value: Any, interface: str, place: Place) -> dict[str, Any] | str:
        if interface == _TIME and value == NOW:
            return NOW
        where = path(place) or "the message"
        if not isinstance(value, Mapping):
            raise MessageError(f"{where} ({interface}): expected its fields", place)
        fields = fields_of(interface, self.find(interface))
        found = {}
        for name, item in nested(value).items():
            if name not in fields:
                listed = f" It has: {', '.join(fields) or 'none'}."
                advice = did_you_mean(name, fields) or listed
                text = f"{where} ({interface}) has no field {name!r}.{advice}"
                raise UnknownField(text, (*place, name))
            found[name] = self._field(item, fields[name], (*place, name))
        return found

    def _field(self, value: Any, field: Field, place: Place) -> Any:
        if not field.is_array:
            return self._item(value, field, place)
        if not isinstance(value, Sequence) or isinstance(value, str):
            raise MessageError(f"{path(place)}: expected a list, not {value!r}", place)
        if field.count is not None and len(value) != field.count:
            text = f"{path(place)}: expected {field.count} values, not {len(value)}"
            raise MessageError(text, place)
        if field.most is not None and len(value) > field.most:
            text = f"{path(place)}: expected at most {field.most} values, not {len(value)}"
            raise MessageError(text, place)
        return [self._item(item, field, (*place, index)) for index, item in enumerate(value)]

    def _item(self, value: Any, field: Field, place: Place) -> Any:
        if field.is_message:
            return self.message(value, field.type, place)
        if field.type in TEXTS:
            return _text(value, field, place)
        if field.type == "bool":
            return _truth(value, place)
        return self._number(value, field.type, place)

    def _number(self, value: Any, kind: str, place: Place) -> int | float:
        number = self._drawn(value, place) if isinstance(value, str) else value
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise MessageError(f"{path(place)}: expected a number, not {value!r}", place)
        if kind in FLOATS:
            number = float(number)
            if kind == "float32" and math.isfinite(number) and abs(number) > _FLOAT32_MAX:
                raise MessageError(f"{path(place)}: {value!r} is too large for {kind}", place)
            return number
        low, high = INTEGERS[kind]
        if not math.isfinite(number) or number != int(number) or not low <= number <= high:
            text = f"{path(place)}: {value!r} is no {kind}, a whole number from {low} to {high}"
            raise MessageError(text, place)
        return int(number)

    def _drawn(self, text: str, place: Place) -> float | int | None:
        if text.startswith("$"):
            if text[1:] not in self.drawn:
                advice = did_you_mean(text[1:], self.drawn)
                message = f"{path(place)}: there is no random value {text[1:]!r}.{advice}"
                raise MessageError(message, place)
            return self.drawn[text[1:]]
        # A whole number of 64 bits does not survive as a float.
        for read in (int, lambda given: parse_any(given)[0], float):
            try:
                return read(text)
            except ValueError:
                continue
        return None


def _text(value: Any, field: Field, place: Place) -> str:
    if not isinstance(value, str):
        raise MessageError(f"{path(place)}: expected text, not {value!r}", place)
    if field.longest is not None and len(value) > field.longest:
        text = f"{path(place)}: longer than {field.longest} characters"
        raise MessageError(text, place)
    return value


def _truth(value: Any, place: Place) -> bool:
    known = {True: True, False: False, "true": True, "false": False}
    lower = value.lower() if isinstance(value, str) else value
    if not isinstance(lower, bool | str) or lower not in known:
        raise MessageError(f"{path(place)}: expected true or false, not {value!r}", place)
    return known[lower]
