"""Which packages of a submission are built apart, and what comes of it."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from grader.machine.ros import RosInstallation
from grader.recording.submission import Definition
from grader.submission.build.standalone_build import lay, standalone
from grader.submission.intake.locate import only, opened
from grader.submission.prepare import Preparation, Prepared, prepare
from grader.submission.read.package import read_package
from tests.submission.samples import CMAKE_OF_MSGS as CMAKE
from tests.submission.samples import INTERFACES, MANIFEST, MANIFEST_OF_MSGS, SETUP_PY, Tree

MSGS = "src/bot_msgs"
NODE = "from bot_msgs.msg import Bot\n\n\ndef main():\n    print(Bot(model=Bot.BURGER))\n"
NEEDS_MSGS = MANIFEST.replace("rclpy", "bot_msgs")


def workspace(tree: Tree, node: str = NODE, manifest: str = NEEDS_MSGS) -> None:
    tree.write(dict(INTERFACES))
    tree.package({"bot_publisher/node.py": node, "package.xml": manifest})


def standalone_build(tree: Tree, ros: RosInstallation) -> tuple[str, ...]:
    with opened(tree.root) as located:
        packages = [read_package(located, folder, ros) for folder in located.packages]
        return standalone(packages, located.files)


def test_an_interface_package_beside_a_node_is_built_apart(
    tree: Tree, named_ros: RosInstallation
) -> None:
    workspace(tree)
    tree.write({f"{MSGS}/README.md": "Messages of the course.\n", f"{MSGS}/LICENSE": "free\n"})
    assert standalone_build(tree, named_ros) == ("bot_msgs",)


COURSE = """
set(files "msg/Bot.msg")
if(BUILD_TESTING)
  find_package(ament_lint_auto REQUIRED)
  set(ament_cmake_copyright_FOUND TRUE)
  ament_lint_auto_find_test_dependencies()
endif()
"""
GLOB = "FILE(GLOB INTERFACES RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} msg/*.msg srv/*.srv)\n"


@pytest.mark.parametrize("more", [COURSE, GLOB, "# as in http://example.org\n"])
def test_usual_styles_are_built_apart(tree: Tree, named_ros: RosInstallation, more: str) -> None:
    workspace(tree)
    tree.write(
        {f"{MSGS}/CMakeLists.txt": CMAKE.replace("ament_package()", f"{more}ament_package()")}
    )
    assert standalone_build(tree, named_ros) == ("bot_msgs",)


@pytest.mark.parametrize(
    "more",
    ['file(GLOB more "../other/msg/*.msg")', "find_package(bot_publisher)"],
)
def test_what_looks_at_others_is_built_with_them(
    tree: Tree, named_ros: RosInstallation, more: str
) -> None:
    workspace(tree)
    tree.write(
        {f"{MSGS}/CMakeLists.txt": CMAKE.replace("ament_package()", f"{more}\nament_package()")}
    )
    assert standalone_build(tree, named_ros) == ()


@pytest.mark.parametrize(
    "files",
    [
        {f"{MSGS}/include/bot.hpp": "#pragma once\n"},
        {f"{MSGS}/bot_msgs/__init__.py": ""},
        {f"{MSGS}/CMakeLists.txt": "project(bot_msgs)\n"},
        {f"{MSGS}/package.xml": MANIFEST_OF_MSGS.replace("geometry_msgs", "bot_publisher")},
        {f"{MSGS}/package.xml": MANIFEST_OF_MSGS.replace("ada@example.org", "a@b.c")},
    ],
    ids=["code", "module", "no interfaces", "needs the other", "wrong manifest"],
)
def test_other_packages_are_built_together(
    tree: Tree, named_ros: RosInstallation, files: dict[str, str]
) -> None:
    workspace(tree)
    tree.write(dict(files))
    assert standalone_build(tree, named_ros) == ()


def test_alone_a_package_has_its_own_files_and_a_hash_of_them(tree: Tree) -> None:
    workspace(tree)
    names = {name.removeprefix("src/") for name in INTERFACES}
    with opened(tree.root) as located, only(located, MSGS, "bot_msgs") as first:
        assert sorted(first.files, key=lambda file: file.path) == list(first.files)
        assert {file.path for file in first.files} == names
        there = {path.relative_to(first.root).as_posix() for path in first.root.rglob("*.*")}
        assert there == names
        assert first.packages == ("bot_msgs",)
    tree.write({"src/bot_publisher/bot_publisher/node.py": "other = 1\n"})
    with opened(tree.root) as located, only(located, MSGS, "bot_msgs") as same:
        assert same.sha256 == first.sha256
    tree.write({f"{MSGS}/msg/Bot.msg": "uint8 other\n"})
    with opened(tree.root) as located, only(located, MSGS, "bot_msgs") as changed:
        assert changed.sha256 != first.sha256


def test_an_install_space_is_laid_where_it_belongs(tmp_path: Path) -> None:
    built, install = tmp_path / "built", tmp_path / "install"
    share = built / "share/bot_msgs"
    (share / "__pycache__").mkdir(parents=True)
    line = '_colcon_package_sh_COLCON_CURRENT_PREFIX="/cache/.unfinished-1/install"\n'
    (share / "package.sh").write_text(f"# a script\n{line}")
    (share / "local_setup.sh").write_text(
        ': ${AMENT_CURRENT_PREFIX:="/cache/.unfinished-1/install"}'
    )
    (share / "link.sh").symlink_to("package.sh")
    (share / "nothing.sh").symlink_to("nothing")
    (share / "folder.sh").mkdir()
    lay("bot_msgs", built, install)
    for name in ("package.sh", "local_setup.sh"):
        text = (install / "share/bot_msgs" / name).read_text()
        assert f'="{install}"' in text
        assert "unfinished" not in text
    assert not (install / "share/bot_msgs/__pycache__").exists()
    assert (share / "package.sh").read_text().endswith(line)


def built(tree: Tree, ros: RosInstallation) -> Prepared:
    return prepare(tree.root, Preparation(ros=ros, cache=tree.root.parent / "cache"))


def kept(tree: Tree) -> set[str]:
    return {file.parent.name for file in (tree.root.parent / "cache/builds").glob("*/build.json")}


def printed(found: Prepared, ros: RosInstallation) -> str:
    """What the node prints, run from the install space as a cell does."""
    assert found.install is not None
    return subprocess.run(
        [str(ros.python), str(found.install / "lib/bot_publisher/bot_pub")],
        env=ros.environment({"HOME": str(found.install)}, (found.install,)),
        capture_output=True,
        text=True,
        check=True,
        timeout=600,
    ).stdout


# setup.py is a student's program: it finds the install space, and spoils what is there.
SPOILS = """\
import os, pathlib
for place in os.environ['PYTHONPATH'].split(':'):
    for file in pathlib.Path(place).rglob('bot_msgs/**/*.py'):
        file.write_text('raise SystemExit("spoiled")')
"""


@pytest.mark.compiles
@pytest.mark.ros
@pytest.mark.slow
def test_messages_are_built_once_and_used_by_each_version_of_a_node(
    tree: Tree, real_ros: RosInstallation
) -> None:
    workspace(tree)
    first = built(tree, real_ros)
    assert first.record.build is not None
    assert first.record.build.succeeded, first.record.build.log
    assert re.findall("Finished <<< (\\S+)", first.record.build.log) == [
        "bot_msgs",
        "bot_publisher",
    ]
    assert str(tree.root.parent) not in first.record.build.log
    assert "model=1" in printed(first, real_ros)
    package = first.record.package("bot_publisher")
    assert package is not None
    assert package.ros_imports[0].module == "bot_msgs"
    messages = first.record.package("bot_msgs")
    assert messages is not None
    text = INTERFACES[f"{MSGS}/msg/Bot.msg"]
    assert messages.definitions == (Definition(f"{MSGS}/msg/Bot.msg", text),)
    assert messages.generated == (Definition("msg/Bot.msg", text),)
    assert messages.groups == ("rosidl_interface_packages",)
    assert messages.cmake == CMAKE
    assert len(kept(tree)) == 2

    # A hostile one has the same messages; only its own are spoiled.
    tree.write({"src/bot_publisher/setup.py": f"{SPOILS}{SETUP_PY}"})
    spoiled = built(tree, real_ros)
    assert len(kept(tree)) == 3
    with pytest.raises(subprocess.CalledProcessError):
        printed(spoiled, real_ros)

    # Another student has them in another folder.
    workspace(tree, NODE.replace("Bot.BURGER", "2"))
    (tree.root / MSGS).rename(tree.root / "messages")
    second = built(tree, real_ros)
    assert len(kept(tree)) == 4
    assert second.record.build is not None
    assert not second.record.build.cached
    assert "model=2" in printed(second, real_ros)
