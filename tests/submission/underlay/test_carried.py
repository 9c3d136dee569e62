"""rosgrade's interface packages as underlays of submissions."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from grader.machine import ros as ros_module
from grader.machine.ros import RosInstallation
from grader.recording.interface import sections_of
from grader.submission.underlay.store import CARRIED, UnderlayStore

EXAMPLE = CARRIED / "example_interfaces"


def definitions(package: Path = EXAMPLE) -> list[Path]:
    return sorted(path for kind in ("msg", "srv", "action") for path in package.glob(f"{kind}/*"))


@pytest.mark.parametrize(
    "package",
    sorted(file.parent for file in CARRIED.glob("*/CMakeLists.txt")),
    ids=lambda path: path.name,
)
def test_every_definition_is_listed_for_cmake_and_every_listed_one_is_there(package: Path) -> None:
    listed = re.findall(r'"(\S+\.(?:msg|srv|action))"', (package / "CMakeLists.txt").read_text())
    found = (path.relative_to(package).as_posix() for path in definitions(package))
    assert sorted(listed) == sorted(found)


@pytest.mark.parametrize("path", definitions(), ids=lambda path: path.name)
def test_every_definition_can_be_read(path: Path) -> None:
    parts = {".msg": 1, ".srv": 2, ".action": 3}[path.suffix]
    name = f"example_interfaces/{path.suffix[1:]}/{path.stem}"
    assert len(sections_of(name, path.read_text(encoding="utf-8"))) == parts


# The same types under the same names are in std_msgs and std_srvs, which the wheels have.
@pytest.mark.ros
@pytest.mark.parametrize("path", definitions(), ids=lambda path: path.name)
def test_what_std_msgs_and_std_srvs_have_is_the_same_here(path: Path) -> None:
    package = {".msg": "std_msgs", ".srv": "std_srvs"}.get(path.suffix, "none")
    theirs = [
        prefix / "share" / package / path.suffix[1:] / path.name
        for prefix in ros_module.find().prefixes
    ]
    found = next((file for file in theirs if file.is_file()), None)
    if found is None:
        assert path.name in ("AddTwoInts.srv", "Fibonacci.action", "WString.msg")
        return
    name = f"example_interfaces/{path.suffix[1:]}/{path.stem}"
    ours, others = (
        [[str(field) for field in part.fields] for part in sections_of(name, file.read_text())]
        for file in (path, found)
    )
    assert ours == others


def test_a_ros_that_has_the_package_is_left_as_it_is(named_ros: RosInstallation) -> None:
    index = named_ros.prefixes[0] / "share/ament_index/resource_index/packages"
    (index / "example_interfaces").touch()
    store = UnderlayStore(Path("/nowhere"), named_ros)
    assert store.completed(named_ros, ["example_interfaces"]) is named_ros


def test_packages_that_are_not_named_are_not_built(named_ros: RosInstallation) -> None:
    store = UnderlayStore(Path("/nowhere"), named_ros)
    assert store.completed(named_ros, ["rclpy", "nav2_msgs"]) is named_ros


def test_underlays_are_seen_behind_the_submission(
    named_ros: RosInstallation, tmp_path: Path
) -> None:
    under, over = tmp_path / "under", tmp_path / "over"
    for prefix in (under, over):
        (prefix / "lib/python3.11/site-packages").mkdir(parents=True)
    index = under / "share/ament_index/resource_index/packages"
    index.mkdir(parents=True)
    (index / "example_interfaces").touch()
    (under / "lib/python3.11/site-packages/example_interfaces").mkdir()
    whole = replace(named_ros, underlays=(under,))
    assert "example_interfaces" in whole.packages & whole.python_modules
    environment = whole.environment({}, (over,))
    for name, below in (
        ("AMENT_PREFIX_PATH", ""),
        ("CMAKE_PREFIX_PATH", ""),
        ("PYTHONPATH", "/lib/python3.11/site-packages"),
        ("LD_LIBRARY_PATH", "/lib"),
    ):
        paths = environment[name].split(":")
        assert paths[:2] == [f"{over}{below}", f"{under}{below}"]
