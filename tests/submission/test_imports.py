from __future__ import annotations

import ast
from textwrap import dedent

import pytest

from grader.recording.submission import Import
from grader.submission.read.imports import find_imports, is_code, ros_imports


def imports(source: str) -> list[tuple[str, int, bool]]:
    found = find_imports(ast.parse(dedent(source)), "node.py")
    return [(item.module, item.line, item.optional) for item in found]


def test_every_form_of_import_is_found_with_its_line() -> None:
    assert imports("""\
        import rclpy, os.path
        from geometry_msgs.msg import Twist
        import importlib

        def main():
            import tf2_ros.buffer as buffer
            nav = importlib.import_module("nav_msgs.msg")
            __import__("sensor_msgs")
    """) == [
        ("os", 1, False),
        ("rclpy", 1, False),
        ("geometry_msgs", 2, False),
        ("importlib", 3, False),
        ("tf2_ros", 6, False),
        ("nav_msgs", 7, False),
        ("sensor_msgs", 8, False),
    ]


def test_relative_imports_stay_in_the_package() -> None:
    assert imports("from . import node\nfrom .node import main\nfrom ..x import y\n") == []


def test_modules_named_at_run_time_are_not_guessed() -> None:
    source = "import_module(name)\nimport_module('.x', 'bot')\nimport_module()\n__import__(f'{x}')"
    assert imports(source) == []


@pytest.mark.parametrize("caught", ["ImportError", "(OSError, ModuleNotFoundError)", ""])
def test_an_import_that_may_fail_is_optional_and_so_is_what_replaces_it(caught: str) -> None:
    source = f"try:\n    import cv2\nexcept {caught}:\n    import PIL\nelse:\n    import numpy\n"
    assert imports(source) == [("cv2", 2, True), ("PIL", 4, True), ("numpy", 6, False)]


def test_imports_for_type_checkers_are_optional() -> None:
    source = "if typing.TYPE_CHECKING:\n    import nav_msgs\nelse:\n    import std_msgs\n"
    assert imports(source) == [("nav_msgs", 2, True), ("std_msgs", 4, False)]


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ("bot/node.py", True),
        ("scripts/run", True),
        ("bot/test/helper.py", True),
        ("node.py", True),
        ("setup.py", False),
        ("test/test_copyright.py", False),
        ("launch/bot.launch.py", False),
        ("bot/bot_launch.py", False),
        ("docs/conf.py", False),
        ("bot/conftest.py", False),
    ],
)
def test_only_what_runs_is_code(path: str, expected: bool) -> None:
    assert is_code(path) is expected


def test_ros_imports_name_the_package_and_leave_out_the_own_and_the_standard_library() -> None:
    found = [Import(name, "n.py", 1) for name in ("PyKDL", "rclpy", "bot", "numpy", "json")]
    packages = {"PyKDL": "python_orocos_kdl_vendor", "rclpy": "rclpy", "bot": "bot", "json": "json"}
    names = [item.module for item in ros_imports(found, own={"bot"}, packages=packages)]
    assert names == ["python_orocos_kdl_vendor", "rclpy"]
