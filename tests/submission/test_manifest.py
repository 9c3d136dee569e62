from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grader.recording.submission import Dependency
from grader.submission.read.manifest import Manifest, read_manifest
from tests.submission.samples import MANIFEST

# catkin_pkg calls pyparsing by names that its newer versions deprecate.
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")

ROS_2 = {"ROS_VERSION": "2", "ROS_DISTRO": "jazzy"}


def read(text: str | bytes) -> Manifest:
    data = text.encode() if isinstance(text, str) else text
    return read_manifest(data, "src/bot/package.xml", ROS_2)


def changed(old: str, new: str) -> Manifest:
    assert old in MANIFEST
    return read(MANIFEST.replace(old, new, 1))


def test_name_build_type_and_dependencies_are_read() -> None:
    assert read(MANIFEST) == Manifest(
        name="bot_publisher",
        description="Publishes a Twist",
        maintainers=("Ada <ada@example.org>",),
        licenses=("Apache-2.0",),
        build_type="ament_python",
        dependencies=(
            Dependency("rclpy", "depend", 8),
            Dependency("geometry_msgs", "depend", 9),
        ),
    )


def test_an_entry_inside_export_is_kept_apart() -> None:
    found = changed("<export>", "<export>\n<exec_depend>std_msgs</exec_depend>")
    assert [entry.name for entry in found.dependencies] == ["rclpy", "geometry_msgs"]
    assert [(entry.name, entry.kind) for entry in found.misplaced] == [
        ("std_msgs", "export/exec_depend")
    ]


def test_the_groups_of_a_package_are_read() -> None:
    tag = "<member_of_group>rosidl_interface_packages</member_of_group>"
    found = changed("</license>", f"</license>{tag}")
    assert found.error is None
    assert found.groups == ("rosidl_interface_packages",)


@pytest.mark.parametrize(
    "tag",
    [
        "build_depend",
        "build_export_depend",
        "buildtool_depend",
        "buildtool_export_depend",
        "exec_depend",
        "test_depend",
        "doc_depend",
    ],
)
def test_every_kind_of_dependency_is_read_with_its_tag(tag: str) -> None:
    manifest = changed("<depend>rclpy</depend>", f"<{tag}> rclpy </{tag}>")
    assert manifest.dependencies[0] == Dependency("rclpy", tag, 8)
    assert manifest.error is None


def test_a_dependency_for_ros_1_only_is_none() -> None:
    condition = '<depend condition="$ROS_VERSION == 1">rospy</depend>'
    manifest = changed("<depend>rclpy</depend>", condition)
    assert [item.name for item in manifest.dependencies] == ["geometry_msgs"]


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("ada@example.org", "a@b.c", 6, 'Invalid email "a@b.c" for person "Ada"'),
        ("<license>Apache-2.0</license>", "", None, 'at least one "license" tag'),
        ("0.0.0", "1.0", 4, 'version "1.0" does not follow version conventions'),
        ("bot_publisher", "Bot Publisher", 3, "does not follow naming conventions"),
        ("depend>rclpy</depend", "run_depend>rclpy</run_depend", 8, "run_depend"),
        ("<depend>rclpy", "<exec_depend>rclpy</exec_depend><depend>rclpy", 8, "redundant"),
        ('format="3"', 'format="9"', None, "format version '9'"),
        ('format="3"', 'format="x"', None, "'x'"),
        ("<depend>", '<depend condition="foo(">', 8, "condition 'foo(' failed to parse"),
        ("</export>", "<build_type>a</build_type></export>", None, "Only one <build_type>"),
    ],
)
def test_what_colcon_does_not_accept_is_an_error_with_its_line(
    old: str, new: str, line: int | None, message: str
) -> None:
    error = changed(old, new).error
    assert error is not None
    assert message in error.message
    assert (error.file, error.line) == ("src/bot/package.xml", line)
    assert "\n" not in error.message


def test_a_tag_that_is_not_closed_is_blamed_where_it_begins() -> None:
    manifest = changed("</name>", "<name>")
    assert str(manifest.error) == "src/bot/package.xml:3: invalid XML: <name> is not closed"
    assert (manifest.name, manifest.build_type) == ("bot_publisher", None)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "the file is empty"),
        (b"\0" * 10, "not well-formed"),
        (b"<a/>", 'single "package" root tag'),
        (b"<package/>", 'exactly one "name" tag'),
        (b'<?xml version="1.0" encoding="klingon"?><package/>', "unknown encoding"),
        (b"<package>" + b"<a>" * 40, "<a> is not closed"),
        (b"<package>%s%s</package>" % (b"<a>" * 30_000, b"</a>" * 30_000), 'one "name" tag'),
        (b"<package>" + b" " * 300_000 + b"</package>", "larger than 256 KiB"),
        (b'<!DOCTYPE p [<!ENTITY a "b">]><package>&a;</package>', "DOCTYPE"),
    ],
)
def test_broken_and_hostile_xml_is_an_error(data: bytes, message: str) -> None:
    error = read(data).error
    assert error is not None
    assert message in error.message


def test_too_many_dependencies_are_an_error() -> None:
    many = "".join(f"<depend>a{number}</depend>" for number in range(600))
    manifest = changed("<depend>", f"{many}<depend>")
    assert manifest.error is not None
    assert "more than 500" in manifest.error.message


@settings(deadline=None)
@given(st.binary(max_size=200), st.integers(0, len(MANIFEST)))
def test_no_damage_to_a_manifest_raises(noise: bytes, place: int) -> None:
    data = MANIFEST.encode()
    read(data[:place] + noise + data[place:])
    read(data[:place] + noise)
