"""What lies under the submissions of an assignment: for the probe, and for students."""

from __future__ import annotations

import shutil
import threading
from dataclasses import replace
from pathlib import Path

import pytest

from grader.assignment.interfaces import FOLDER
from grader.assignment.load import LoadedAssignment, load_assignment
from grader.errors import AssignmentError, GraderFault
from grader.grading.type_support import TypeSupport, missing_underlays, wanted_underlays
from grader.machine import resources, ros
from grader.machine.ros import RosInstallation
from grader.recording.interface import sections_of
from grader.submission.underlay.store import MissingUnderlay
from tests.submission.samples import PACKAGE


def test_an_assignment_of_ros_messages_needs_nothing(tmp_path: Path) -> None:
    installation = RosInstallation("wheels", tmp_path / "python", (tmp_path,))
    support = TypeSupport(load_assignment("timed_publisher"), installation, tmp_path / "cache")
    assert support.prefixes() == ()
    assert not (tmp_path / "cache").exists()


@pytest.mark.parametrize(
    ("submission", "names"), [(None, ["rclcpp"]), ("cpp/timed_publisher", ["rclcpp"]), ("qos", [])]
)
def test_rclcpp_is_wanted_where_a_submission_is_or_may_be_in_cpp(
    submission: str | None, names: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    installation = RosInstallation("wheels", tmp_path / "python", (tmp_path,))
    index = tmp_path / "share/ament_index/resource_index/packages"
    index.mkdir(parents=True)
    for name in ("ament_cmake", "geometry_msgs", "rclpy", "std_msgs"):
        (index / name).touch()
    monkeypatch.setattr("grader.grading.type_support.find", lambda: installation)
    folder = None if submission is None else resources.reference() / submission
    wanted = wanted_underlays(load_assignment("timed_publisher"), folder)
    assert [one.name for one in wanted] == names


def test_what_is_only_named_or_carried_along_is_not_built_and_what_is_compiled_against_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    installation = RosInstallation("wheels", tmp_path / "python", (tmp_path,))
    monkeypatch.setattr("grader.grading.type_support.find", lambda: installation)
    package = tmp_path / "bot"
    package.mkdir()
    (package / "package.xml").write_text(
        PACKAGE["package.xml"]
        .replace("<depend>rclpy</depend>", "<depend>rclcpp_action</depend>")
        .replace("<depend>geometry_msgs</depend>", "<exec_depend>nav2_bringup</exec_depend>")
        .replace("ament_python", "ament_cmake")
    )
    (package / "CMakeLists.txt").write_text(
        "find_package(tf2_ros REQUIRED)\nfind_package(OpenCV REQUIRED)\ninstall(DIRECTORY launch)\n"
        "find_package(turtlesim REQUIRED)\n"
    )
    wanted = wanted_underlays(load_assignment("timed_publisher"), package)
    assert [one.name for one in wanted] == ["rclcpp_action", "tf2_ros"]


def test_what_only_cpp_needs_is_wanted_where_students_may_write_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    installation = RosInstallation("wheels", tmp_path / "python", (tmp_path,))
    monkeypatch.setattr("grader.grading.type_support.find", lambda: installation)
    loaded = load_assignment(resources.root() / "docs/examples/autonomy_stack")
    names = [one.name for one in wanted_underlays(loaded)]
    assert names == ["tf2", "launch", "rclcpp", "rclcpp_lifecycle", "tf2_ros"]


def test_the_copy_is_that_of_the_reference() -> None:
    copies = load_assignment("custom_interface").folder / FOLDER
    for copy in (path for path in copies.rglob("*") if path.is_file()):
        reference = resources.reference() / "custom_interface" / copy.relative_to(copies)
        assert copy.read_bytes() == reference.read_bytes(), copy


def test_what_was_deleted_is_built_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    built: list[Path] = []
    installation = RosInstallation("wheels", tmp_path / "python", (tmp_path,))

    def build(_support: TypeSupport, for_probe: bool, _on_build: object) -> RosInstallation:
        assert for_probe
        built.append(tmp_path / f"prefix{len(built)}")
        (built[-1] / "share/ament_index/resource_index/rosidl_interfaces").mkdir(parents=True)
        return replace(installation, underlays=(built[-1],))

    monkeypatch.setattr(TypeSupport, "_built", build)
    support = TypeSupport(load_assignment("timed_publisher"), installation, tmp_path / "cache")
    assert support.prefixes() == support.prefixes() == (built[0],)
    shutil.rmtree(built[0])
    assert support.prefixes() == (built[1],)


@pytest.mark.compiles
@pytest.mark.ros
@pytest.mark.slow
def test_the_copy_of_the_assignment_is_built_and_has_the_definition_that_is_asked_for(
    tmp_path: Path,
) -> None:
    loaded = load_assignment("custom_interface")
    told: list[str] = []
    support = TypeSupport(loaded, ros.find(), tmp_path)
    (prefix,) = support.prefixes(told.append)
    assert any("building enpm702_msgs" in line for line in told)
    assert support.prefixes() == (prefix,)
    built = (prefix / "share/enpm702_msgs/msg/BotStatus.msg").read_text(encoding="utf-8")
    asked = next(b.spec.with_ for b in loaded.checks if b.spec.id == "fields")
    assert sections_of(asked["interface"], built)[0].fields == (
        sections_of(asked["interface"], asked["definition"])[0].fields
    )


ASSIGNMENT = """\
rosgrade: 1
id: arms
title: Arms
packages: [{name: bot_publisher, executables: [bot_pub]}, {name: hand}]
scenarios: [{id: run, launch: [{executable: bot_pub, package: bot_publisher}], timeout: 5 s}]
checks: [{id: builds, uses: package.builds, with: {package: bot_publisher}, points: 1}]
"""


def arms(folder: Path, more: str = "") -> LoadedAssignment:
    """An assignment that brings the packages arm and hand along; students write hand."""
    for name in ("arm", "hand"):
        for path, text in PACKAGE.items():
            file = folder / "arms/packages" / name / path.replace("bot_publisher", name)
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text.replace("bot_publisher", name))
    (folder / "arms/assignment.yaml").write_text(ASSIGNMENT + more)
    return load_assignment(folder / "arms")


def test_an_underlay_that_is_not_there_ends_grading_before_it_begins(tmp_path: Path) -> None:
    installation = RosInstallation("wheels", tmp_path / "python", (tmp_path,))
    loaded = arms(tmp_path, "underlays: [tf2]\n")
    with pytest.raises(MissingUnderlay, match=r"'tf2' .* rosgrade underlay add tf2$"):
        TypeSupport(loaded, installation, tmp_path)


def test_an_underlay_that_does_not_exist_is_told_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(AssignmentError, match=r"yaml:7: underlays\[0\]: no underlay 'tf3'"):
        arms(tmp_path, "underlays: [tf3]\n")


@pytest.mark.ros
@pytest.mark.slow
def test_packages_beside_an_assignment_are_given_to_students_but_not_what_they_have_to_write(
    tmp_path: Path,
) -> None:
    support = TypeSupport(arms(tmp_path), ros.find(), tmp_path / "cache")
    student = support.student()
    assert {"arm", "hand"} & student.packages == {"arm"}
    # Neither has interfaces.
    assert support.prefixes() == ()


@pytest.mark.ros
def test_interfaces_of_an_underlay_that_is_not_built_are_not_refused_but_it_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "arms").mkdir()
    (tmp_path / "arms/robots.repos").write_text(
        "repositories:\n  robots:\n    {type: git, url: https://example.org, version: 1.0.0}\n"
    )
    record = "record: [{topic: /arm, type: robot_msgs/msg/Arm}]"
    text = ASSIGNMENT.replace("timeout: 5 s", f"timeout: 5 s, {record}")
    monkeypatch.setattr(f"{__name__}.ASSIGNMENT", text)
    with pytest.raises(AssignmentError, match="there is no package 'robot_msgs'"):
        arms(tmp_path)
    loaded = arms(tmp_path, "underlays: [robots.repos]\n")
    assert [str(tmp_path / "arms/robots.repos") in one for one in missing_underlays(loaded)] == [
        True
    ]


@pytest.mark.ros
def test_an_interrupt_ends_the_build_of_interfaces(tmp_path: Path) -> None:
    stop = threading.Event()
    support = TypeSupport(load_assignment("custom_interface"), ros.find(), tmp_path, stop)

    def on_build(told: str) -> None:
        if ": building " in told:
            stop.set()

    with pytest.raises(GraderFault, match="interrupted"):
        support.prefixes(on_build)
    assert stop.is_set() and not list(tmp_path.glob("builds/*/build.json"))
