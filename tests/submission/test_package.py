from __future__ import annotations

import pytest

from grader.machine.ros import RosInstallation
from grader.recording.submission import Import, PackageRecord
from grader.submission.build.installed import InstallSpace
from grader.submission.intake.locate import opened
from grader.submission.read.package import read_package
from grader.submission.read.package_record import record_packages
from tests.submission.samples import MANIFEST, NODE, Tree

FOLDER = "src/bot_publisher"


def records(
    tree: Tree, ros: RosInstallation, installed: InstallSpace | None = None
) -> dict[str, PackageRecord]:
    with opened(tree.root) as located:
        packages = [read_package(located, folder, ros) for folder in located.packages]
    return {record.name: record for record in record_packages(packages, ros, installed)}


def test_a_good_package_is_recorded(tree: Tree, named_ros: RosInstallation) -> None:
    tree.package()
    record = records(tree, named_ros)["bot_publisher"]
    assert (record.path, record.build_type) == (FOLDER, "ament_python")
    assert record.manifest_error is None
    assert [(item.name, item.line, item.known) for item in record.dependencies] == [
        ("rclpy", 8, True),
        ("geometry_msgs", 9, True),
    ]
    node = f"{FOLDER}/bot_publisher/node.py"
    assert record.imports == (Import("rclpy", node, 1), Import("geometry_msgs", node, 2))
    assert record.ros_imports == record.imports
    assert record.entry_points == (("bot_pub", "bot_publisher.node:main"),)
    assert record.missing_targets == record.syntax_errors == record.executables == ()


def test_scripts_without_a_suffix_are_read(tree: Tree, named_ros: RosInstallation) -> None:
    tree.package({"scripts/run": "#!/usr/bin/env python3\nimport std_msgs.msg\n", "scripts/x": "("})
    record = records(tree, named_ros)["bot_publisher"]
    assert Import("std_msgs", f"{FOLDER}/scripts/run", 2) in record.ros_imports
    assert record.syntax_errors == ()


def test_ros_packages_that_are_not_installed_are_known_by_name(
    tree: Tree, named_ros: RosInstallation
) -> None:
    source = "import tf2_ros, cv_bridge, nav2_msgs.msg, numpy, os, bot_publisher, bot_msgs.msg\n"
    tree.package({"bot_publisher/node.py": source})
    tree.write({"src/bot_msgs/package.xml": MANIFEST.replace("bot_publisher", "bot_msgs")})
    record = records(tree, named_ros)["bot_publisher"]
    assert [item.module for item in record.ros_imports] == [
        "bot_msgs",
        "cv_bridge",
        "nav2_msgs",
        "tf2_ros",
    ]
    assert {item.module for item in record.imports} >= {"numpy", "os", "bot_publisher"}


@pytest.mark.parametrize("declared", ["tf2_ros", "tf2_ros_py"])
def test_of_packages_that_provide_a_module_the_declared_one_counts(
    tree: Tree, named_ros: RosInstallation, declared: str
) -> None:
    manifest = MANIFEST.replace("geometry_msgs", declared)
    tree.package({"bot_publisher/node.py": "import tf2_ros\n", "package.xml": manifest})
    assert records(tree, named_ros)["bot_publisher"].ros_imports[0].module == declared


def test_a_broken_manifest_does_not_hide_the_rest(tree: Tree, named_ros: RosInstallation) -> None:
    tree.package({"package.xml": "<package><name>bot"})
    tree.package({"package.xml": MANIFEST.replace("bot_publisher", "good")}, folder="src/good")
    found = records(tree, named_ros)
    assert set(found) == {"bot_publisher", "good"}
    broken = found["bot_publisher"]
    assert broken.manifest_error is not None
    assert broken.manifest_error.file == f"{FOLDER}/package.xml"
    assert broken.build_type == "ament_python"
    assert broken.entry_points == (("bot_pub", "bot_publisher.node:main"),)
    assert found["good"].manifest_error is None


def test_a_package_that_is_named_nowhere_has_its_folders_name(
    tree: Tree, named_ros: RosInstallation
) -> None:
    tree.write({"my_bot/package.xml": "", "my_bot/CMakeLists.txt": ""})
    assert records(tree, named_ros)["my_bot"].build_type == "ament_cmake"


def test_modules_below_src_are_found(tree: Tree, named_ros: RosInstallation) -> None:
    tree.package({"bot_publisher/node.py": None})
    tree.write({f"{FOLDER}/src/bot_publisher/node.py": NODE})
    assert records(tree, named_ros)["bot_publisher"].missing_targets == ()


def test_odd_names_are_written_so_that_json_can_hold_them(
    tree: Tree, named_ros: RosInstallation
) -> None:
    tree.package({"bot_publisher/new\nline\udce9.py": "import rclpy\n"})
    files = [item.file for item in records(tree, named_ros)["bot_publisher"].imports]
    assert f"{FOLDER}/bot_publisher/new\\nline\\udce9.py" in files


def test_what_was_built_wins_over_what_was_declared(
    tree: Tree, named_ros: RosInstallation, tmp_path_factory: pytest.TempPathFactory
) -> None:
    from grader.submission.build.installed import inspect

    tree.package()
    install = Tree(tmp_path_factory.mktemp("install"))
    install.write(
        {
            "lib/python3.12/site-packages/bot_publisher-0.0.0-py3.12.egg-info/entry_points.txt": (
                "[console_scripts]\nbot_pub = bot_publisher.other:main\nnew = bot_publisher:run\n"
            ),
            "lib/python3.12/site-packages/bot_publisher/__init__.py": "",
            "bin/bot_pub": "",
        }
    )
    installed = inspect(install.root, ["bot_publisher"], {})
    record = records(tree, named_ros, installed)["bot_publisher"]
    assert record.entry_points == (
        ("bot_pub", "bot_publisher.other:main"),
        ("new", "bot_publisher:run"),
    )
    assert record.misplaced_executables == ("bin/bot_pub",)
    assert [name for name, _ in record.missing_targets] == ["bot_pub", "new"]
