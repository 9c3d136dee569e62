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
        if isinstance(item, list):
            setattr(message, name, _items(item, types[name], now_ns))
        else:
            setattr(message, name, _item(getattr(message, name), item, now_ns))
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


def _items(items: Sequence[Any], type: str, now_ns: int) -> list[Any]:
    """The items of a field of a type such as ``sequence<geometry_msgs/Point, 5>``."""
    inner = type.removeprefix("sequence<").partition(">")[0].partition("[")[0].partition(",")[0]
    if "/" in inner:
        package, _, name = inner.partition("/")
        make = import_interface(f"{package}/msg/{name}")
        return [_item(make(), item, now_ns) for item in items]
    return [bytes([item]) for item in items] if inner == "octet" else list(items)


def _item(default: Any, item: Any, now_ns: int) -> Any:
    """The value of a field, or of an item, that holds a default now."""
    if item == _NOW and hasattr(default, "nanosec"):
        return filled(default, {"sec": now_ns // NS, "nanosec": now_ns % NS}, now_ns)
    if isinstance(item, Mapping):
        return filled(default, item, now_ns)
    return bytes([item]) if isinstance(default, bytes) else item
