"""What students can do wrong before anything is built never raises; see test_build for the rest."""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path

import pytest

from grader.errors import UsageError
from grader.machine.ros import RosInstallation
from grader.submission.prepare import Preparation, Prepared, fingerprint, prepare
from tests.submission.samples import NODE, Tree, tar_bytes, tar_member, zip_bytes


def prepared(path: Path, ros: RosInstallation) -> Prepared:
    return prepare(path, Preparation(ros=ros, cache=path.parent / "cache"))


def problem(path: Path, ros: RosInstallation) -> str:
    found = prepared(path, ros)
    assert found.install is None
    assert found.record.build is None
    assert found.record.problem is not None
    return found.record.problem


def test_an_empty_folder_and_an_empty_zip(
    tree: Tree, tmp_path: Path, named_ros: RosInstallation
) -> None:
    (tmp_path / "a.zip").write_bytes(zip_bytes())
    for path in (tree.root, tmp_path / "a.zip"):
        assert problem(path, named_ros) == "the submission is empty"


@pytest.mark.parametrize(
    ("files", "hint"),
    [
        ({"bot.txt": ""}, "no package.xml was found"),
        ({"node.py": NODE}, "hand in the whole package, not only its Python files"),
        ({".gitmodules": "", "README.md": ""}, "run `git submodule update --init`"),
        ({"bot.rar": ""}, "unpack bot.rar, and hand in its content"),
        ({"install/bot/package.xml": "", "x": ""}, "build, install, log"),
        ({"COLCON_IGNORE": "", "bot/package.xml": ""}, "folders with a COLCON_IGNORE"),
        ({".src/bot/package.xml": ""}, "hidden folders"),
    ],
)
def test_a_submission_without_a_package_gets_advice(
    tree: Tree, named_ros: RosInstallation, files: dict[str, str | bytes], hint: str
) -> None:
    assert hint in problem(tree.write(files), named_ros)


def test_two_packages_of_one_name_are_both_named(tree: Tree, named_ros: RosInstallation) -> None:
    tree.package(folder="src/bot")
    found = problem(tree.package(folder="old/bot"), named_ros)
    assert (
        found == "two packages are called bot_publisher: old/bot and src/bot; hand in one of them"
    )


def test_a_refused_archive_is_a_problem_of_the_submission(
    tmp_path: Path, named_ros: RosInstallation
) -> None:
    (tmp_path / "eve.tar.gz").write_bytes(tar_bytes(tar_member("../../evil", b"x")))
    found = prepared(tmp_path / "eve.tar.gz", named_ros).record
    assert (found.id, found.packages) == ("eve", ())
    assert found.sha256 == sha256((tmp_path / "eve.tar.gz").read_bytes()).hexdigest()
    assert found.problem == "eve.tar.gz: ../../evil: paths with '..' are refused"


def test_the_packages_of_a_submission_with_a_problem_are_recorded_all_the_same(
    tree: Tree, named_ros: RosInstallation
) -> None:
    tree.package(folder="a")
    found = prepared(tree.package(folder="b"), named_ros).record
    assert [package.path for package in found.packages] == ["a", "b"]


def test_a_path_that_does_not_exist_is_a_wrong_use(
    tmp_path: Path, named_ros: RosInstallation
) -> None:
    with pytest.raises(UsageError, match="does not exist"):
        prepared(tmp_path / "nobody", named_ros)


def test_two_folders_that_are_refused_are_not_taken_for_the_same(
    tmp_path: Path, named_ros: RosInstallation
) -> None:
    prints = set()
    for number in range(3):
        folder = tmp_path / str(number) / "ws"
        (folder / "/".join("x" * (50 + number))).mkdir(parents=True)
        assert "folders are nested too deep" in problem(folder, named_ros)
        prints |= {fingerprint(folder), fingerprint(folder)}
    assert len(prints) == 3
