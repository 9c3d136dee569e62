from __future__ import annotations

import os
from pathlib import Path

import pytest

from grader.errors import SubmissionError
from grader.submission.intake.listing import find_packages, list_files
from grader.submission.intake.members import ArchiveLimits
from tests.submission.samples import Tree


def listed(root: Path) -> list[str]:
    return [file.path for file in list_files(root)]


def test_files_are_listed_in_the_same_order_everywhere(tree: Tree) -> None:
    root = tree.write({"b.py": "", "a/z.py": "", "a/A.py": "", "a.py": ""})
    assert listed(root) == ["a.py", "a/A.py", "a/z.py", "b.py"]


@pytest.mark.parametrize(
    "name",
    [
        ".git/config",
        "__pycache__/x.py",
        ".venv/x.py",
        "node_modules/x.js",
        ".pytest_cache/x",
        "bot.egg-info/PKG-INFO",
        "x.pyc",
        ".DS_Store",
        "._x.py",
        "rosgrade-report/result.json",
        ".node.py.swp",
        "node.py~",
        "4913",
        ".#node.py",
        "#node.py#",
        "node.py___jb_tmp___",
    ],
)
def test_what_tools_leave_behind_is_no_part_of_a_submission(tree: Tree, name: str) -> None:
    tree.package()
    before = listed(tree.root)
    assert listed(tree.write({f"src/bot_publisher/{name}": "x"})) == before


def test_a_virtual_environment_of_any_name_is_left_out(tree: Tree) -> None:
    assert listed(tree.write({"myenv/pyvenv.cfg": "", "myenv/lib/x.py": "", "x.py": ""})) == [
        "x.py"
    ]


@pytest.mark.parametrize("folder", ["build", "install", "log", "ws/build"])
def test_what_colcon_made_in_a_workspace_is_left_out(tree: Tree, folder: str) -> None:
    root = tree.write({f"{folder}/bot/package.xml": "", "src/bot/package.xml": ""})
    assert listed(root) == ["src/bot/package.xml"]


def test_what_colcon_made_inside_a_package_is_known_by_its_marks(tree: Tree) -> None:
    root = tree.write({"package.xml": "", "log/COLCON_IGNORE": "", "install/local_setup.sh": ""})
    assert listed(root) == ["package.xml"]


def test_a_link_inside_is_kept_as_a_link(tree: Tree) -> None:
    root = tree.write({"a/x.py": ""})
    (root / "y.py").symlink_to("a/x.py")
    (root / "z.py").symlink_to(root / "a/x.py")
    links = {file.path: file.link for file in list_files(root) if file.link}
    assert links == {"y.py": "a/x.py", "z.py": "a/x.py"}


@pytest.mark.parametrize("target", ["/etc/passwd", "../secret", "a/../../secret"])
def test_a_link_out_of_the_submission_is_refused(tree: Tree, target: str) -> None:
    root = tree.write({"a/x.py": ""})
    (root / "y.py").symlink_to(target)
    with pytest.raises(SubmissionError, match=r"y\.py: the link to .* leads out"):
        list_files(root)


def test_a_link_to_what_is_left_out_or_to_nothing_is_left_out(tree: Tree) -> None:
    root = tree.write({"build/compile_commands.json": "", "x.py": ""})
    (root / "compile_commands.json").symlink_to("build/compile_commands.json")
    (root / ".#x.py").symlink_to("ada@laptop.1234")
    (root / "log").symlink_to("/tmp")
    assert listed(root) == ["x.py"]


def test_pipes_are_not_opened(tree: Tree) -> None:
    root = tree.write({"x.py": ""})
    os.mkfifo(root / "pipe")
    assert listed(root) == ["x.py"]


def test_too_many_files_are_refused(tree: Tree) -> None:
    root = tree.write({f"{number}": "" for number in range(11)})
    with pytest.raises(SubmissionError, match="more than 10 files"):
        list_files(root, ArchiveLimits(members=10))


def test_too_large_a_submission_is_refused_and_the_largest_file_named(tree: Tree) -> None:
    root = tree.write({"a.bag": b"x" * 3_000_000})
    with pytest.raises(SubmissionError, match=r"more than 2 MiB \(.*a\.bag, 2\.9 MiB\)"):
        list_files(root, ArchiveLimits(total_bytes=2 * 2**20))


def test_too_deep_a_submission_is_refused(tree: Tree) -> None:
    root = tree.write({"/".join("x" * 50): ""})
    with pytest.raises(SubmissionError, match="folders are nested too deep"):
        list_files(root)


def test_a_package_or_a_module_of_one_may_be_called_log(tree: Tree) -> None:
    names = ["bot/bot/log/__init__.py", "bot/package.xml", "log/package.xml"]
    assert listed(tree.write(dict.fromkeys(names, ""))) == names


@pytest.mark.parametrize(
    ("paths", "packages"),
    [
        (["a/package.xml", "b/COLCON_IGNORE", "b/c/package.xml"], ["a"]),
        (["a/package.xml", "AMENT_IGNORE"], []),
        (
            ["z/y/src/bot/package.xml", "z/y/src/bot/in/package.xml", "a/package.xml"],
            ["a", "z/y/src/bot"],
        ),
        (["package.xml", "-x/package.xml", "a/package.xml"], ["."]),
        ([".hidden/a/package.xml", "b/package.xml"], ["b"]),
    ],
)
def test_packages_are_found_as_colcon_finds_them(paths: list[str], packages: list[str]) -> None:
    assert find_packages(paths) == packages
