"""Messages from their bytes: plain CDR, as DDS sends it, by the text of their definition.

https://www.omg.org/spec/DDSI-RTPS/2.5 (10.2), https://mcap.dev/spec/registry ("ros2msg")
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from struct import Struct, unpack_from
from typing import Any

from grader.recording.interface import Field, fields_of

_NUMBERS = {
    **{"bool": "?", "byte": "B", "char": "B", "float32": "f", "float64": "d"},
    **{"int8": "b", "int16": "h", "int32": "i", "int64": "q"},
    **{"uint8": "B", "uint16": "H", "uint32": "I", "uint64": "Q"},
}
"""Primitive types that are no text, and how :mod:`struct` calls them."""
_HEADER = 4
_NEXT = re.compile(r"^={3,}\s*^MSG: *(\S+)$", re.MULTILINE)

_Read = Callable[[bytes, int], tuple[Any, int]]
"""From bytes and a position in them to the value there and the position behind it."""


def decoder(type: str, definition: str) -> Callable[[bytes], dict[str, Any]]:
    """Make a function from the bytes of a message to its fields by name.

    Nested messages are dictionaries too, arrays are lists, and arrays of bytes are bytes. The
    function raises errors of any kind on other bytes than the type has.

    Args:
        definition: That of the type, and of all types that it contains, as in an MCAP file.

    Raises:
        ValueError: A type has no definition here, or is one that cannot be read.
    """
    main, *others = _NEXT.split(definition)
    texts = {type: main}
    for name, text in zip(others[::2], others[1::2], strict=True):
        package, _, short = name.replace("/msg/", "/").partition("/")
        texts[f"{package}/msg/{short}"] = text
    big, little = (_Types(texts, order).reader(type) for order in "><")

    def decode(data: bytes) -> dict[str, Any]:
        read = little if data[1] & 1 else big
        value: dict[str, Any] = read(data[_HEADER:], 0)[0]
        return value

    return decode


class _Types:
    """Readers of types, in one order of bytes: that of the host that sent them."""

    def __init__(self, texts: Mapping[str, str], order: str) -> None:
        self._texts, self._order = texts, order
        self._count = self._number("uint32")

    def reader(self, type: str) -> _Read:
        """What reads one value of a type."""
        if type == "string":
            return self._string
        if type in _NUMBERS:
            return self._number(type)
        if type not in self._texts:
            raise ValueError(f"a {type} cannot be read")
        fields = fields_of(type, self._texts[type]).values()
        # A message without a field has one byte: IDL allows no empty structure.
        readers = [(one.name, self._field(one)) for one in fields]
        empty = None if readers else self._number("uint8")

        def read(data: bytes, at: int) -> tuple[dict[str, Any], int]:
            value = {}
            for name, field in readers:
                value[name], at = field(data, at)
            return value, empty(data, at)[1] if empty else at

        return read

    def _field(self, field: Field) -> _Read:
        if not field.is_array:
            return self.reader(field.type)
        if field.type in _NUMBERS:
            return self._numbers(field.type, field.count)
        one, fixed, count = self.reader(field.type), field.count, self._count

        def read(data: bytes, at: int) -> tuple[list[Any], int]:
            number, at = (fixed, at) if fixed is not None else count(data, at)
            found = []
            for _ in range(number):
                value, at = one(data, at)
                found.append(value)
            return found, at

        return read

    def _number(self, type: str) -> _Read:
        packed = Struct(self._order + _NUMBERS[type])
        size, unpack = packed.size, packed.unpack_from

        def read(data: bytes, at: int) -> tuple[Any, int]:
            # Each number begins at a multiple of its size.
            at += -at % size
            return unpack(data, at)[0], at + size

        return read

    def _numbers(self, type: str, fixed: int | None) -> _Read:
        order, code, count = self._order, _NUMBERS[type], self._count
        size, is_bytes = Struct(f"{order}{code}").size, type in ("byte", "uint8")

        def read(data: bytes, at: int) -> tuple[Any, int]:
            number, at = (fixed, at) if fixed is not None else count(data, at)
            # Where there is none, nothing is aligned.
            at += -at % size if number else 0
            found = unpack_from(f"{order}{number}{code}", data, at)
            end = at + number * size
            return data[at:end] if is_bytes else list(found), end

        return read

    def _string(self, data: bytes, at: int) -> tuple[str, int]:
        length, at = self._count(data, at)
        end = at + length
        if end > len(data):
            raise ValueError("a text longer than its message")
        # A zero ends it, which is counted; some writers leave it out where there is no text.
        return data[at : end - 1].decode() if length else "", end
