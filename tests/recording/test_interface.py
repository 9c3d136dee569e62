from __future__ import annotations

import pytest

from grader.machine import ros
from grader.recording.interface import (
    Constant,
    DefinitionError,
    Field,
    Section,
    fields_of,
    sections_of,
)

BOT_STATUS = """\
# Which robot
uint8 BURGER=1
uint8 WAFFLE = 2
uint8 model  # one of them
geometry_msgs/Pose2D pose
float64[2] velocities
"""


def section(text: str, interface: str = "bot_msgs/msg/Bot") -> Section:
    (found,) = sections_of(interface, text)
    return found


def test_fields_and_constants_of_a_message() -> None:
    found = section(BOT_STATUS)
    assert found.fields == (
        Field("model", "uint8"),
        Field("pose", "geometry_msgs/msg/Pose2D"),
        Field("velocities", "float64", is_array=True, count=2),
    )
    assert found.constants == (Constant("BURGER", "uint8", "1"), Constant("WAFFLE", "uint8", "2"))
    assert [found.lines.get(name) for name in ("BURGER", "velocities", "speed")] == [2, 6, None]


@pytest.mark.parametrize(
    "written",
    [
        "uint8 model",
        "geometry_msgs/Pose2D pose",
        "float64[] values",
        "float64[2] values",
        "float64[<=2] values",
        "string<=10 name",
        "string<=10[<=5] names",
    ],
)
def test_a_field_is_written_as_it_was_read(written: str) -> None:
    assert str(section(written).fields[0]) == written


def test_a_type_of_the_own_package_may_stand_without_it() -> None:
    alike = ("Wheel left", "bot_msgs/Wheel left", "bot_msgs/msg/Wheel left")
    assert {section(text).fields[0].type for text in alike} == {"bot_msgs/msg/Wheel"}


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("uint8 A=0x10", "16"),
        ("int8 A = -3", "-3"),
        ("float64 A=1", "1.0"),
        ("bool A=True", "true"),
        ("string A='x y'", "x y"),
        ('string A="x y"', "x y"),
    ],
)
def test_constants_are_equal_however_they_are_written(written: str, value: str) -> None:
    assert section(written).constants[0].value == value


def test_the_parts_of_a_service_and_of_an_action() -> None:
    service = sections_of("bot_msgs/srv/Add", "int64 a\nint64 b\n---\nint64 sum\n")
    assert [[field.name for field in part.fields] for part in service] == [["a", "b"], ["sum"]]
    assert len(sections_of("bot_msgs/action/Go", "---\n---\n")) == 3


@pytest.mark.parametrize("line", ["uint8", "float64[2 values", "model: uint8", "8 model"])
def test_a_line_that_cannot_be_read_is_named(line: str) -> None:
    with pytest.raises(DefinitionError, match=r"line 2: .* is neither") as raised:
        section(f"uint8 model\n{line}\n")
    assert raised.value.line == 2


def test_fields_by_name_leave_out_constants() -> None:
    assert list(fields_of("bot_msgs/msg/Bot", BOT_STATUS)) == ["model", "pose", "velocities"]


@pytest.mark.ros
def test_every_message_of_ros_is_read_as_ros_reads_it() -> None:
    parser = pytest.importorskip("rosidl_adapter.parser")
    files = [file for prefix in ros.find().prefixes for file in prefix.glob("share/*/msg/*.msg")]
    assert len(files) > 100
    for file in files:
        package, name = file.parent.parent.name, file.stem
        text = file.read_text(encoding="utf-8")
        theirs = parser.parse_message_string(package, name, text)
        ours = section(text, f"{package}/msg/{name}")
        assert [str(field) for field in ours.fields] == [
            f"{field.type} {field.name}" for field in theirs.fields
        ], file
        assert [(item.name, item.type) for item in ours.constants] == [
            (item.name, item.type) for item in theirs.constants
        ], file
