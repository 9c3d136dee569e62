"""Messages of rclpy from plain values, and back."""

from __future__ import annotations

import array
from collections.abc import Mapping, Sequence
from typing import Any

from grader.recording.model import NS
from grader.run.cell.interfaces import import_interface

_NOW = "now"


def filled(message: Any, value: Mapping[str, Any], now_ns: int) -> Any:
    """Set fields of a message, by name and nested; checked when the order was made."""
    types = message.get_fields_and_field_types()
    for name, item in value.items():
        before = getattr(message, name)
        if isinstance(item, list):
            setattr(message, name, _items(item, types[name], now_ns))
        else:
            setattr(message, name, _item(before, item, now_ns))
    return message


def plain(value: Any) -> Any:
    """Mappings, lists and scalars from a message, as :mod:`json` writes them."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, bytes | bytearray):
        return list(value) if len(value) != 1 else value[0]
    if isinstance(value, list | tuple | array.array):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, str):
        # What is no text (a lone surrogate) cannot be written down.
        return value.encode(errors="replace").decode()
    return value


def _items(items: Sequence[Any], kind: str, now_ns: int) -> list[Any]:
    inner = kind.removeprefix("sequence<").partition(">")[0].partition("[")[0].partition(",")[0]
    if "/" in inner:
        package, _, short = inner.partition("/")
        make = import_interface(f"{package}/msg/{short}")
        return [_item(make(), item, now_ns) for item in items]
    return [bytes([item]) for item in items] if inner == "octet" else list(items)


def _item(before: Any, item: Any, now_ns: int) -> Any:
    if item == _NOW and hasattr(before, "nanosec"):
        return filled(before, {"sec": now_ns // NS, "nanosec": now_ns % NS}, now_ns)
    if isinstance(item, Mapping):
        return filled(before, item, now_ns)
    return bytes([item]) if isinstance(before, bytes) else item
