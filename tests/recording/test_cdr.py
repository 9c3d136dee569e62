"""Messages are read from their bytes as others write them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import get_types_from_msg
from rosbags.typesys.store import Typestore

from grader.recording.cdr import decoder

TYPE = "bot_msgs/msg/All"
SEPARATOR = "=" * 80
DEFINITION = f"""\
uint8 MODE=3  # a constant is no field
bool ready
int64 far
byte raw
char letter 65
float32 slope
string<=20 name "none"
uint16[3] fixed
float64[] open
int32[<=4] bounded
bool[] flags
uint8[] data
string[] names
bot_msgs/Part part
Part[] parts
Nothing nothing
int16 last
{SEPARATOR}
MSG: bot_msgs/Part
float64 x
int8 side
{SEPARATOR}
MSG: bot_msgs/msg/Nothing
# It has no field.
"""
PART = {"x": 0.1, "side": -1}
VALUE = {
    "ready": True,
    "far": -(2**40),
    "raw": 100,
    "letter": 66,
    "slope": 0.5,
    "name": "Grüße",
    "fixed": [1, 2, 65_535],
    "open": [1.5, -2.5],
    "bounded": [],
    "flags": [True, False],
    "data": b"\x00\xff",
    "names": ["", "a"],
    "part": PART,
    "parts": [PART, {"x": -1e300, "side": 127}],
    "nothing": {},
    "last": -7,
}
ARRAYS = {
    **{"fixed": np.uint16, "open": np.float64, "bounded": np.int32},
    **{"flags": np.bool_, "data": np.uint8},
}


def message(value: dict[str, Any]) -> SimpleNamespace:
    """A message as rosbags takes it."""
    found = dict(value)
    for name, kind in ARRAYS.items():
        found[name] = np.array(list(value[name]), dtype=kind)
    found["part"] = SimpleNamespace(**value["part"])
    found["parts"] = [SimpleNamespace(**part) for part in value["parts"]]
    found["nothing"] = SimpleNamespace(structure_needs_at_least_one_member=0)
    return SimpleNamespace(**found)


def written(value: dict[str, Any], *, little_endian: bool = True) -> bytes:
    store = Typestore()
    store.register(get_types_from_msg(DEFINITION, TYPE))
    return bytes(store.serialize_cdr(message(value), TYPE, little_endian=little_endian))


@pytest.mark.parametrize("little_endian", [True, False])
@pytest.mark.parametrize("changes", [{}, {"open": []}, {"parts": []}, {"name": "", "names": []}])
def test_a_message_is_read_as_rosbags_writes_it(
    changes: dict[str, Any], little_endian: bool
) -> None:
    value = {**VALUE, **changes}
    assert decoder(TYPE, DEFINITION)(written(value, little_endian=little_endian)) == value


def test_bytes_that_end_too_early_are_no_message() -> None:
    read, data = decoder(TYPE, DEFINITION), written(VALUE)
    for end in range(len(data)):
        with pytest.raises(Exception, match=r"."):
            read(data[:end])


def test_a_length_that_no_message_has_is_refused_at_once() -> None:
    read = decoder("std_msgs/msg/String", "string data\n")
    with pytest.raises(ValueError, match="a text longer than its message"):
        read(b"\x00\x01\x00\x00" + b"\xff\xff\xff\x7f" + b"abc")


def test_a_type_without_a_definition_is_named() -> None:
    with pytest.raises(ValueError, match="a bot_msgs/msg/Gone cannot be read"):
        decoder("bot_msgs/msg/One", "Gone gone\n")
