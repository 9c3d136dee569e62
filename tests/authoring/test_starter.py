"""Starter packages: real packages, for every assignment, that give nothing away."""

from __future__ import annotations

import ast
import configparser
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
from catkin_pkg.package import parse_package_string

from grader.assignment.load import LoadedAssignment, list_assignments, load_assignment
from grader.authoring.starter import starter_files, write_starter
from grader.errors import UsageError
from grader.machine import resources

LESSON = """\
rosgrade: 1
id: lesson
title: {title}
contract:
  packages:
    talker:
      depends: [rclpy]
      executables:
        hear: {{}}
        speak: {{node: /robot/speaker}}
    talker_msgs:
      build_type: ament_cmake
      depends: [std_msgs]
      executables: {{tool: {{}}}}
      interfaces:
        srv/Ask: {{definition: "---"}}
        action/Go: {{definition: "---\\n---"}}
  points: {{talker_builds: 1, node: 1}}
scenarios:
  - id: run
    launch: [{{package: talker, executable: speak}}]
    timeout: 5 s
"""


def lesson(folder: Path, title: str = "Talk") -> LoadedAssignment:
    place = folder / "lesson"
    place.mkdir()
    (place / "assignment.yaml").write_text(LESSON.format(title=title), encoding="utf-8")
    return load_assignment(place)


@pytest.mark.parametrize("name", list_assignments())
def test_each_assignment_has_a_starter_that_ros_can_read(name: str) -> None:
    loaded = load_assignment(name)
    files = starter_files(loaded)
    for package in loaded.assignment.packages:
        manifest = parse_package_string(files[f"{package.name}/package.xml"])
        manifest.validate()
        assert manifest.name == package.name
        assert manifest.get_build_type() == package.build_type
        named = {dependency.name for dependency in manifest.exec_depends}
        assert set(package.depends) <= named
    for path, text in files.items():
        if path.endswith(".py"):
            ast.parse(text, path)
    first = loaded.assignment.packages[0].name
    assert f"rosgrade show {name}" in files[f"{first}/README.md"]
    assert f"rosgrade watch {name} ~/ros2_ws" in files[f"{first}/README.md"]


def test_a_single_program_lies_in_the_module_that_the_handouts_name() -> None:
    files = starter_files(load_assignment("timed_publisher"))
    assert "'bot_pub = bot_publisher.bot_publisher:main'," in files["bot_publisher/setup.py"]
    assert "class BotPublisher(Node):" in files["bot_publisher/bot_publisher/bot_publisher.py"]
    setup = configparser.ConfigParser()
    setup.read_string(files["bot_publisher/setup.cfg"])
    assert setup["install"]["install_scripts"] == "$base/lib/bot_publisher"


def test_a_node_is_called_as_the_contract_wants_it(tmp_path: Path) -> None:
    files = starter_files(load_assignment("executors"))
    for module in ("single_threaded", "multi_threaded"):
        code = files[f"executors_demo/executors_demo/{module}.py"]
        assert "super().__init__('executor_demo')" in code
    files = starter_files(lesson(tmp_path))
    assert "super().__init__('speaker')" in files["talker/talker/speak.py"]
    assert "super().__init__('hear')" in files["talker/talker/hear.py"]


def test_an_interface_package_generates_what_the_contract_names(tmp_path: Path) -> None:
    files = starter_files(lesson(tmp_path))
    assert files["talker_msgs/srv/Ask.srv"].splitlines()[-1:] == ["---"]
    assert files["talker_msgs/action/Go.action"].splitlines()[-2:] == ["---", "---"]
    cmake = files["talker_msgs/CMakeLists.txt"]
    assert '"srv/Ask.srv"' in cmake and "DEPENDENCIES std_msgs" in cmake
    manifest = parse_package_string(files["talker_msgs/package.xml"])
    assert [group.name for group in manifest.member_of_groups] == ["rosidl_interface_packages"]


def test_a_package_for_cmake_has_programs_in_cpp(tmp_path: Path) -> None:
    files = starter_files(lesson(tmp_path))
    assert not any(name.endswith(".py") for name in files if name.startswith("talker_msgs/"))
    node = files["talker_msgs/src/talker_msgs.cpp"]
    assert "class TalkerMsgs : public rclcpp::Node" in node and ': Node("talker_msgs")' in node
    cmake = files["talker_msgs/CMakeLists.txt"]
    assert "add_executable(tool src/talker_msgs.cpp)" in cmake
    assert "ament_target_dependencies(tool rclcpp std_msgs)" in cmake
    assert "install(TARGETS tool\n  DESTINATION lib/${PROJECT_NAME}\n)" in cmake
    manifest = parse_package_string(files["talker_msgs/package.xml"])
    assert [one.name for one in manifest.build_depends] == ["rclcpp", "std_msgs"]


@pytest.mark.parametrize("name", list_assignments())
def test_each_assignment_has_a_starter_in_cpp(name: str) -> None:
    loaded = load_assignment(name)
    files = starter_files(loaded, cpp=True)
    assert not any(path.endswith((".py", "setup.cfg")) for path in files)
    for package in loaded.assignment.packages:
        manifest = parse_package_string(files[f"{package.name}/package.xml"])
        assert manifest.get_build_type() == "ament_cmake"
        wanted = {"rclcpp" if one == "rclpy" else one for one in package.depends}
        assert {one.name for one in manifest.build_depends} == wanted
        cmake = files[f"{package.name}/CMakeLists.txt"]
        assert all(f"find_package({one} REQUIRED)" in cmake for one in wanted)
        for executable in package.executables:
            (source,) = re.findall(rf"add_executable\({executable} (\S+)\)", cmake)
            assert "rclcpp::spin(" in files[f"{package.name}/{source}"]
            assert f"install(TARGETS {executable}\n  DESTINATION lib/${{PROJECT_NAME}}" in cmake


def test_each_language_is_given_what_it_needs() -> None:
    loaded = load_assignment(resources.root() / "docs/examples/autonomy_stack")
    depends = {}
    for cpp in (False, True):
        files = starter_files(loaded, cpp=cpp)
        manifest = parse_package_string(files["autonomy/package.xml"])
        depends[cpp] = {one.name for one in manifest.exec_depends}
    assert depends[False] - depends[True] == {"rclpy", "tf2_ros_py"}
    assert depends[True] - depends[False] == {"rclcpp", "rclcpp_lifecycle", "tf2_ros"}
    # CMake does not find what is built by setup.py.
    cmake = files["autonomy/CMakeLists.txt"]
    assert "find_package(tf2_ros REQUIRED)" in cmake and "launch" not in cmake


def test_cpp_is_refused_where_an_assignment_takes_python_only(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"takes talker in Python only .* leave out --cpp"):
        write_starter(lesson(tmp_path), tmp_path / "src", cpp=True)
    assert not (tmp_path / "src").exists()


def test_a_package_for_cmake_that_needs_rclpy_installs_its_programs(tmp_path: Path) -> None:
    text = LESSON.replace("depends: [std_msgs]", "depends: [std_msgs, rclpy]")
    (tmp_path / "lesson").mkdir()
    (tmp_path / "lesson" / "assignment.yaml").write_text(text.format(title="Talk"))
    files = starter_files(load_assignment(tmp_path / "lesson"))
    assert files["talker_msgs/scripts/talker_msgs.py"].startswith("#!/usr/bin/env python3\n")
    assert "RENAME tool" in files["talker_msgs/CMakeLists.txt"]


def test_a_title_may_hold_any_character(tmp_path: Path) -> None:
    title = 'Say "it\'s" <twice> & \'again\' \\ """'
    loaded = lesson(tmp_path, title="|-\n  " + title)
    files = starter_files(loaded)
    manifest = ElementTree.fromstring(files["talker/package.xml"])
    assert manifest.findtext("description") == title
    assert title in {
        node.value
        for node in ast.walk(ast.parse(files["talker/setup.py"]))
        if isinstance(node, ast.Constant)
    }


def test_what_is_there_already_is_left_as_it_is(tmp_path: Path) -> None:
    loaded = lesson(tmp_path)
    there = tmp_path / "src" / "talker_msgs"
    there.mkdir(parents=True)
    with pytest.raises(UsageError, match="talker_msgs is there already, and is left as it is"):
        write_starter(loaded, tmp_path / "src")
    assert list((tmp_path / "src").iterdir()) == [there]
    assert list(there.iterdir()) == []


def test_it_is_written_whole(tmp_path: Path) -> None:
    written = write_starter(lesson(tmp_path), tmp_path / "ws" / "src")
    assert [path.name for path in written] == ["talker", "talker_msgs"]
    assert sorted(path.name for path in (tmp_path / "ws" / "src").iterdir()) == [
        "talker",
        "talker_msgs",
    ]
    assert (written[0] / "resource" / "talker").read_text() == ""
