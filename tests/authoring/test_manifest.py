"""A mistake in the files of a package is made in any right package."""

from __future__ import annotations

import ast
import re
from dataclasses import replace
from xml.etree import ElementTree

import pytest

from grader.assignment.changed_reference import mutate
from grader.assignment.mutant import Mutant
from grader.authoring.mutants.manifest import CHANGES, EDITS, Files, PackageFiles, misspelt
from grader.checks.catalogue import CATALOGUE

XML = """\
<?xml version="1.0"?>
<!-- Größe -->
<package format="3">
  <name>bot</name>
  <maintainer email="student@example.com">Student</maintainer>
  <depend>rclpy</depend>
  <exec_depend>geometry_msgs</exec_depend>
  <build_depend>geometry_msgs</build_depend>
  <export><build_type>ament_python</build_type></export>
</package>
"""
SETUP = """\
# Größe
from setuptools import find_packages, setup

name = 'bot'

setup(
    name=name,
    packages=find_packages(exclude=['test']),
    data_files=[('share/ament_index/resource_index/packages', ['resource/' + name])],
    entry_points={'console_scripts': [ 'pub = bot.node:main', "sub=bot.sub:main"]},
)
"""
CMAKE = """\
cmake_minimum_required(VERSION 3.8)
project(bot)
find_package(rclcpp REQUIRED)
find_package(geometry_msgs REQUIRED)
set(sources src/node.cpp src/pub.cpp)
add_library(motion src/motion.cpp)
target_include_directories(motion PUBLIC include)
add_executable(pub ${sources})
add_executable(sub src/sub.cpp)
target_link_libraries(pub motion)
ament_target_dependencies(pub
  rclcpp geometry_msgs)
install(TARGETS
  pub
  sub
  DESTINATION lib/${PROJECT_NAME}
)
ament_package()
"""
PYTHON = PackageFiles(
    "bot",
    {
        "package.xml": XML,
        "setup.py": SETUP,
        "setup.cfg": "[develop]",
        "resource/bot": "",
        "bot/node.py": "import rclpy\n\nfrom .command import Command\n",
        "bot/other.py": "from std_msgs.msg import String\n",
        "bot/command.py": "from geometry_msgs.msg import (\n    Twist as Größe,\n    Vector3,\n)\n",
    },
    about="pub",
)
CPP = PackageFiles(
    "bot",
    {
        "package.xml": XML,
        "CMakeLists.txt": CMAKE,
        "src/node.cpp": '#include "geometry_msgs/msg/pose2_d_stamped.hpp"\n',
        "src/pub.cpp": "int main(int argc, char ** argv)\n{\n  rclcpp::init(argc, argv);\n}\n",
    },
    about="pub",
)
CMAKE_FILE = "CMakeLists.txt"
GROUP, RUN, TOOL = "member_of_group", "exec_depend", "buildtool_depend"
DEFINITION = """\
# States
uint8 STOPPED=1
uint8 MOVING=2  # or about to

uint8 state  # one of them
# Where it is
geometry_msgs/msg/Pose2D pose
float64 spare
float64[<=2] wheels
"""
INTERFACES_CMAKE = """\
project(bot_msgs)
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
rosidl_generate_interfaces(${PROJECT_NAME}
  "msg/BotState.msg"
  DEPENDENCIES std_msgs geometry_msgs
)
ament_package()
"""
INTERFACES_XML = """\
<package format="3">
  <name>bot_msgs</name>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
  <depend>geometry_msgs</depend>
  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
</package>
"""
INTERFACES = PackageFiles(
    "bot_msgs",
    {
        "bot_msgs/package.xml": INTERFACES_XML,
        "bot_msgs/CMakeLists.txt": INTERFACES_CMAKE,
        "bot_msgs/msg/BotState.msg": DEFINITION,
        "bot/package.xml": XML.replace("rclpy", "bot_msgs"),
        "bot/bot/node.py": "from bot_msgs.msg import BotState\n\n"
        "BotState(state=BotState.STOPPED, pose=Pose2D(), wheels=[])\n",
    },
    folder="bot_msgs/",
    about="bot_msgs/msg/BotState",
)


def made(kind: str, package: PackageFiles) -> Files:
    """What a mutant has in place of the files of a package."""
    return next(make(package) for name, _, _, make in CHANGES if name == kind)


def text_of(kind: str, package: PackageFiles, path: str) -> str:
    """A file of a mutant."""
    return made(kind, package)[path] or ""


def gone(kind: str, package: PackageFiles, path: str) -> list[str]:
    """The lines of the only file of a mutant that the right package has and the mutant has not."""
    (changed,) = made(kind, package).items()
    assert changed[0] == path
    left = (changed[1] or "").splitlines()
    return [one.strip() for one in package.texts[path].splitlines() if one not in left]


def depends(files: Files) -> list[str]:
    root = ElementTree.fromstring(files["package.xml"] or "")
    return [one.text or "" for one in root if one.tag.endswith("depend")]


def test_a_dependency_is_missing_misspelt_or_inside_export_wherever_it_stands() -> None:
    assert depends(made("dependency_missing", PYTHON)) == ["rclpy"]
    other = ["rclpy", "geometry_msg", "geometry_msg"]
    assert depends(made("dependency_misspelt", PYTHON)) == other
    inside = made("dependency_inside_export", PYTHON)
    assert depends(inside) == ["rclpy"]
    export = ElementTree.fromstring(inside["package.xml"] or "").find("export")
    found = sorted(one.text or "" for one in export or ())
    assert found == ["ament_python", "geometry_msgs", "geometry_msgs"]


def test_the_client_library_is_the_dependency_where_there_is_no_other() -> None:
    alone = PackageFiles("bot", {"package.xml": XML.replace("geometry_msgs", "rclpy")})
    assert depends(made("dependency_missing", alone)) == []


def test_what_is_written_otherwise_in_package_xml_is_seen_all_the_same() -> None:
    written = XML.replace(
        "  <depend>rclpy", "  <!-- <depend>std_msgs</depend> -->\n  <depend>rclpy"
    )
    written = written.replace("<exec_depend>", '<exec_depend condition="$ROS_VERSION == 2">')
    other = replace(PYTHON, texts={**PYTHON.texts, "package.xml": written})
    assert depends(made("dependency_missing", other)) == ["rclpy"]
    quoted = written.replace('email="student@example.com"', "email='student@example.com'")
    other = replace(PYTHON, texts={**PYTHON.texts, "package.xml": quoted})
    assert 'email="student@laptop"' in text_of("email_invalid", other, "package.xml")


def test_an_address_becomes_invalid() -> None:
    text = text_of("email_invalid", PYTHON, "package.xml")
    assert ElementTree.fromstring(text)[1].get("email") == "student@laptop"


def scripts(files: Files) -> list[str]:
    tree = ast.parse(files["setup.py"] or "")
    found = [node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)]
    return [text for text in found if isinstance(text, str) and "=" in text]


def test_one_entry_point_is_gone_misnamed_or_to_nothing_and_the_other_stays() -> None:
    assert scripts(made("entry_point_missing", PYTHON)) == ["sub=bot.sub:main"]
    other = replace(PYTHON, about="sub")
    assert scripts(made("executable_misnamed", other)) == [
        "pub = bot.node:main",
        "su=bot.sub:main",
    ]
    assert scripts(made("entry_point_to_nothing", PYTHON))[0] == "pub = bot.node:main_"


def test_the_message_that_a_program_imports_is_misspelt_where_it_is_imported() -> None:
    # The module of the entry point imports none, another module of the package is not in use.
    text = text_of("import_misspelt", PYTHON, "bot/command.py")
    assert text == "from geometry_msgs.msg import (\n    Twis as Größe,\n    Vector3,\n)\n"
    own = {**PYTHON.texts, "bot/node.py": "from std_srvs.srv import Empty, Trigger\n"}
    text = text_of("import_misspelt", replace(PYTHON, texts=own), "bot/node.py")
    # What is not about the import does not change.
    assert text == "from std_srvs.srv import Empt as Empty, Trigger\n"


@pytest.mark.parametrize("call", ["setup(", "setuptools.setup("])
def test_setup_fails_before_it_installs_anything(call: str) -> None:
    written = {**PYTHON.texts, "setup.py": SETUP.replace("\nsetup(", f"\n{call}")}
    text = text_of("setup_raises", replace(PYTHON, texts=written), "setup.py")
    with pytest.raises(NameError, match="packagename"):
        exec(text.replace("from setuptools import find_packages, setup", ""), {})


@pytest.mark.parametrize(
    ("written", "named"),
    [
        (SETUP, "name = 'bo" + "ts'"),
        (SETUP.replace("name=name", "name='bot'").replace("name = 'bot'", ""), "name='bots'"),
        (SETUP.replace("find_packages(exclude=['test'])", "[name]"), "packages=['bot']"),
        (SETUP.replace("'resource/' + name", "'resource/bot'"), "'resource/bots'"),
    ],
)
def test_a_package_gets_another_name_and_keeps_its_modules(written: str, named: str) -> None:
    short = PackageFiles("bot", {**PYTHON.texts, "setup.py": written})
    changed = made("package_misnamed", short)
    other = misspelt("bot")
    assert f"<name>{other}</name>" in (changed["package.xml"] or "")
    text = changed["setup.py"] or ""
    assert named.replace("bots", other) in text
    assert "bot.node:main" in text
    assert changed["resource/bot"] is None
    assert changed[f"resource/{other}"] == ""


def test_whoever_uses_interfaces_follows_when_their_package_gets_another_name() -> None:
    changed = made("package_misnamed", INTERFACES)
    assert "<name>bot_msg</name>" in (changed["bot_msgs/package.xml"] or "")
    assert "project(bot_msg)" in (changed["bot_msgs/CMakeLists.txt"] or "")
    assert "<depend>bot_msg</depend>" in (changed["bot/package.xml"] or "")
    assert "from bot_msg.msg import BotState" in (changed["bot/bot/node.py"] or "")


def test_cmake_installs_one_executable_less_or_one_of_another_name_or_elsewhere() -> None:
    text = text_of("not_installed", CPP, "CMakeLists.txt")
    assert "install(TARGETS sub DESTINATION lib/${PROJECT_NAME}\n)" in text
    alone = {"CMakeLists.txt": CMAKE.replace("  sub\n", "")}
    text = text_of("not_installed", replace(CPP, texts=alone), "CMakeLists.txt")
    assert "install" not in text
    text = text_of("executable_misnamed", CPP, "CMakeLists.txt")
    assert text.endswith("set_target_properties(pub PROPERTIES OUTPUT_NAME pu)\nament_package()\n")
    assert "project(bo)" in text_of("package_misnamed", CPP, "CMakeLists.txt")
    text = text_of("installed_in_bin", CPP, "CMakeLists.txt")
    assert "  sub\n  DESTINATION bin\n)" in text


def test_cmake_lacks_one_of_the_commands_that_a_build_needs() -> None:
    assert gone("package_not_found", CPP, CMAKE_FILE) == ["find_package(geometry_msgs REQUIRED)"]
    assert gone("target_dependencies_missing", CPP, CMAKE_FILE) == [
        "ament_target_dependencies(pub",
        "rclcpp geometry_msgs)",
    ]
    assert gone("include_folder_missing", CPP, CMAKE_FILE) == [
        "target_include_directories(motion PUBLIC include)"
    ]
    assert gone("library_not_linked", CPP, CMAKE_FILE) == ["target_link_libraries(pub motion)"]
    assert "(sub src/sub_.cpp)" in text_of("source_misspelt", CPP, CMAKE_FILE)


def test_a_program_in_cpp_lacks_its_header_or_its_init() -> None:
    text = text_of("header_misspelt", CPP, "src/node.cpp")
    assert text == '#include "geometry_msgs/msg/Pose2DStamped.hpp"\n'
    # Its file stands in a variable of CMake, behind another one.
    assert gone("never_initialised", CPP, "src/pub.cpp") == ["rclcpp::init(argc, argv);"]


@pytest.mark.parametrize(
    ("kind", "line", "other"),
    [
        ("field_missing", "float64 spare\n", ""),
        ("integer_of_another_size", "uint8 state", "int64 state"),
        ("float_of_another_size", "float64 spare", "float32 spare"),
        ("array_without_bound", "float64[<=2] wheels", "float64[] wheels"),
        (
            "fields_in_another_order",
            "uint8 state  # one of them\n# Where it is\ngeometry_msgs/msg/Pose2D pose\n",
            "geometry_msgs/msg/Pose2D pose\n# Where it is\nuint8 state  # one of them\n",
        ),
        ("type_without_package", "geometry_msgs/msg/Pose2D", "Pose2D"),
        # The other constant and the other fields are in use: a program would end without them.
        ("constant_missing", "uint8 MOVING=2  # or about to\n", ""),
        ("constant_with_another_value", "MOVING=2", "MOVING=100"),
    ],
)
def test_a_definition_is_wrong_in_one_line(kind: str, line: str, other: str) -> None:
    assert DEFINITION.count(line) == 1
    text = text_of(kind, INTERFACES, "bot_msgs/msg/BotState.msg")
    assert text == DEFINITION.replace(line, other)


def test_a_definition_is_not_where_it_is_asked_for() -> None:
    right = "bot_msgs/msg/BotState.msg"
    for kind, other in {
        "definition_in_wrong_folder": "msgs/BotState.msg",
        "definition_in_lower_case": "msg/bot_state.msg",
        "interface_not_listed": "msg/OtherBotState.msg",
    }.items():
        changed = made(kind, INTERFACES)
        assert changed[f"bot_msgs/{other}"] == DEFINITION
        assert f'"{other}"' in (changed["bot_msgs/CMakeLists.txt"] or "")
        assert changed[right] == (DEFINITION if kind == "interface_not_listed" else None)


@pytest.mark.parametrize(
    ("kind", "file", "line"),
    [
        ("generators_not_found", CMAKE_FILE, "find_package(rosidl_default_generators REQUIRED)"),
        ("dependencies_missing_in_cmake", CMAKE_FILE, "DEPENDENCIES std_msgs geometry_msgs"),
        ("ament_package_missing", CMAKE_FILE, "ament_package()"),
        ("no_member_of_group", "package.xml", f"<{GROUP}>rosidl_interface_packages</{GROUP}>"),
        ("runtime_undeclared", "package.xml", f"<{RUN}>rosidl_default_runtime</{RUN}>"),
        ("generators_undeclared", "package.xml", f"<{TOOL}>rosidl_default_generators</{TOOL}>"),
        ("used_package_undeclared", "package.xml", "<depend>geometry_msgs</depend>"),
    ],
)
def test_a_package_of_interfaces_lacks_an_entry(kind: str, file: str, line: str) -> None:
    assert gone(kind, INTERFACES, f"bot_msgs/{file}") == [line]


def test_a_package_of_interfaces_generates_nothing() -> None:
    text = text_of("never_generated", INTERFACES, "bot_msgs/CMakeLists.txt")
    assert text == re.sub(r"rosidl_generate_interfaces[^)]*\)\n", "", INTERFACES_CMAKE)


def test_a_package_that_cmake_looks_for_stays_registered() -> None:
    cmake = {**INTERFACES.texts, "bot/CMakeLists.txt": "find_package(bot_msgs REQUIRED)"}
    assert made("ament_package_missing", replace(INTERFACES, texts=cmake)) == {}


def test_a_mistake_for_which_there_is_no_place_changes_nothing() -> None:
    for kind in ("setup_raises", "setup_cfg_missing", "resource_file_missing", "import_misspelt"):
        assert made(kind, CPP) == {}
    for kind in ("not_installed", "installed_in_bin", "package_not_found", "never_initialised"):
        assert made(kind, PYTHON) == {}
    assert made("entry_point_missing", replace(PYTHON, about="other")) == {}
    assert made("not_installed", replace(CPP, about="other")) == {}
    bare = {"bot_msgs/package.xml": "<package/>", "bot_msgs/msg/BotState.msg": "string text\n"}
    for kind, _, checks, make in CHANGES:
        if any(check.startswith("interface.") for check in checks) and kind != "field_missing":
            assert make(replace(INTERFACES, texts=bare)) == {}, kind


@pytest.mark.parametrize("package", [PYTHON, CPP, INTERFACES], ids=["python", "cpp", "interfaces"])
def test_each_mistake_gives_another_submission(package: PackageFiles) -> None:
    reference = {path: text.encode() for path, text in package.texts.items()}
    for kind, title, checks, make in CHANGES:
        assert {*checks} <= {*CATALOGUE}, kind
        changed = make(package) if ("interface." in checks[0]) == (package is INTERFACES) else {}
        if changed:
            mutant = Mutant(id=kind, title=title, files=dict(changed), loses=("starts",))
            assert mutate(mutant, reference)[1] == [], kind


def test_the_table_of_edits_has_no_row_twice() -> None:
    assert len({name for name, *_ in CHANGES}) == len(CHANGES) > len(EDITS) > 0
