"""A mistake in package.xml, setup.py or CMakeLists.txt is made in any right package."""

from __future__ import annotations

import ast
from xml.etree import ElementTree

import pytest

from grader.authoring.mutants import manifest
from grader.authoring.mutants.manifest import PackageFiles

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
add_executable(pub src/pub.cpp)
add_executable(sub src/sub.cpp)
install(TARGETS
  pub
  sub
  DESTINATION lib/${PROJECT_NAME}
)
ament_package()
"""
PYTHON = PackageFiles(
    "bot",
    {"package.xml": XML, "setup.py": SETUP, "setup.cfg": "[develop]", "resource/bot": ""},
)
CPP = PackageFiles("bot", {"package.xml": XML, "CMakeLists.txt": CMAKE, "src/pub.cpp": "int x;"})


def depends(files: manifest.Files) -> list[str]:
    root = ElementTree.fromstring(files["package.xml"] or "")
    return [one.text or "" for one in root if one.tag.endswith("depend")]


def test_a_dependency_is_missing_misspelt_or_inside_export_wherever_it_stands() -> None:
    assert depends(manifest.missing_dependency(PYTHON)) == ["rclpy"]
    misspelt = ["rclpy", "geometry_msg", "geometry_msg"]
    assert depends(manifest.misspelt_dependency(PYTHON)) == misspelt
    inside = manifest.dependency_inside_export(PYTHON)
    assert depends(inside) == ["rclpy"]
    export = ElementTree.fromstring(inside["package.xml"] or "").find("export")
    assert [one.text for one in export or ()] == ["ament_python", "geometry_msgs", "geometry_msgs"]


def test_the_client_library_is_the_dependency_where_there_is_no_other() -> None:
    alone = PackageFiles("bot", {"package.xml": XML.replace("geometry_msgs", "rclpy")})
    assert depends(manifest.missing_dependency(alone)) == []


def test_an_address_becomes_invalid() -> None:
    text = manifest.invalid_email(PYTHON)["package.xml"] or ""
    assert ElementTree.fromstring(text)[1].get("email") == "student@laptop"


def scripts(files: manifest.Files) -> list[str]:
    tree = ast.parse(files["setup.py"] or "")
    found = [node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)]
    return [text for text in found if isinstance(text, str) and "=" in text]


def test_one_entry_point_is_gone_misnamed_or_to_nothing_and_the_other_stays() -> None:
    assert scripts(manifest.no_entry_point(PYTHON, "pub")) == ["sub=bot.sub:main"]
    assert scripts(manifest.misnamed_entry_point(PYTHON, "sub")) == [
        "pub = bot.node:main",
        "su=bot.sub:main",
    ]
    assert scripts(manifest.entry_point_to_nothing(PYTHON, "pub"))[0] == "pub = bot.node:main_"


def test_setup_fails_before_it_installs_anything() -> None:
    text = manifest.broken_setup(PYTHON)["setup.py"] or ""
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
    changed = manifest.misnamed_package(short)
    other = manifest.misspelt("bot")
    assert f"<name>{other}</name>" in (changed["package.xml"] or "")
    text = changed["setup.py"] or ""
    assert named.replace("bots", other) in text
    assert "bot.node:main" in text
    assert changed["resource/bot"] is None
    assert changed[f"resource/{other}"] == ""


def test_cmake_installs_one_executable_less_or_one_of_another_name() -> None:
    text = manifest.not_installed(CPP, "pub")["CMakeLists.txt"] or ""
    assert "install(TARGETS sub DESTINATION lib/${PROJECT_NAME}\n)" in text
    alone = PackageFiles("bot", {"CMakeLists.txt": CMAKE.replace("  sub\n", "")})
    assert "install" not in (manifest.not_installed(alone, "pub")["CMakeLists.txt"] or "")
    text = manifest.misnamed_entry_point(CPP, "pub")["CMakeLists.txt"] or ""
    assert text.endswith("set_target_properties(pub PROPERTIES OUTPUT_NAME pu)\nament_package()\n")
    assert "project(bo)" in (manifest.misnamed_package(CPP)["CMakeLists.txt"] or "")


def test_a_mistake_for_which_there_is_no_place_changes_nothing() -> None:
    for change in (manifest.broken_setup, manifest.no_setup_cfg, manifest.no_marker):
        assert change(CPP) == {}
    assert manifest.not_installed(PYTHON, "pub") == {}
    assert manifest.no_entry_point(PYTHON, "other") == {}
    assert manifest.not_installed(CPP, "other") == {}
