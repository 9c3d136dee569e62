"""Underlays are built once for a ROS installation, and kept."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from grader.errors import GraderFault, UsageError
from grader.machine.ros import RosInstallation
from grader.submission.underlay.definition import Underlay, find_underlay
from grader.submission.underlay.store import MissingUnderlay, UnderlayStore
from tests.submission.underlay.conftest import Repository


def earlier(cache: Path, ros: RosInstallation, name: str, *packages: str) -> Path:
    """A named set as an earlier rosgrade built it."""
    folder = cache / "underlays/builds/earlier"
    (folder / "install").mkdir(parents=True)
    about = {"name": name, "ros": str(ros.prefixes[0]), "packages": packages, "places": [name]}
    (folder / "underlay.json").write_text(json.dumps(about))
    return folder


def test_a_set_that_an_earlier_rosgrade_built_is_left_out_and_can_be_removed(
    named_ros: RosInstallation, tmp_path: Path
) -> None:
    folder = earlier(tmp_path, named_ros, "tf2", "tf2", "tf2_ros_py")
    store = UnderlayStore(tmp_path, named_ros)
    assert store.installed() == []
    assert store.missing([find_underlay("tf2")])
    assert store.needed(named_ros, {"tf2"}) == named_ros
    assert store.kept.remove("tf2")
    assert not folder.exists()
    assert not store.kept.remove("tf2")


def repos(tmp_path: Path, *entries: str) -> Underlay:
    tmp_path.mkdir(exist_ok=True)
    (tmp_path / "course.repos").write_text("repositories:\n" + "".join(entries))
    return find_underlay("course.repos", tmp_path)


def test_where_ros_has_the_packages_nothing_is_built_and_nothing_is_missing(
    named_ros: RosInstallation, tmp_path: Path
) -> None:
    underlay = find_underlay("tf2")
    for name in underlay.listed:
        (named_ros.prefixes[0] / "share/ament_index/resource_index/packages" / name).touch()
    told: list[str] = []
    store = UnderlayStore(tmp_path / "cache", named_ros, told.append)
    assert store.missing([underlay]) == store.add([underlay], 1.0) == []
    assert store.lay([underlay]) == named_ros
    assert told == ["tf2: this ROS has its packages, nothing is built"]


def test_where_nothing_is_built_no_library_is_looked_for(
    named_ros: RosInstallation, repository: Repository, tmp_path: Path
) -> None:
    entry = repository.entry("1.0.0", packages="[arm]")
    underlay = repos(tmp_path, entry, "python: [no-such-library]\n")
    store = UnderlayStore(tmp_path / "cache", named_ros)
    with pytest.raises(GraderFault, match=r"course needs the library 'no-such-library'"):
        store.add([underlay], 1.0)
    (named_ros.prefixes[0] / "share/ament_index/resource_index/packages/arm").touch()
    assert UnderlayStore(tmp_path / "cache", replace(named_ros)).add([underlay], 1.0) == []


def test_what_is_missing_is_a_fault_of_ours_with_the_command_that_gets_it(
    named_ros: RosInstallation, tmp_path: Path
) -> None:
    store = UnderlayStore(tmp_path, named_ros)
    with pytest.raises(MissingUnderlay, match=r"rosgrade underlay add tf2$"):
        store.lay([find_underlay("tf2")])
    asked = [find_underlay(name) for name in ("launch", "tf2")]
    assert store.missing(asked) == asked
    assert str(MissingUnderlay(asked[0])) == (
        "the underlay 'launch' is not built here for this ROS installation; to get it: "
        "rosgrade underlay add launch"
    )
    with pytest.raises(MissingUnderlay, match=r"'launch', 'tf2' are .* add launch tf2$"):
        store.fetched(asked)


def test_two_versions_of_a_package_are_refused_before_anything_is_built(
    named_ros: RosInstallation, repository: Repository, tmp_path: Path
) -> None:
    repository.commit("arm", "leg", tag="1.0.0")
    other = Repository(tmp_path / "others")
    other.commit("arm", tag="2.0.0")
    both = repos(tmp_path, repository.entry("1.0.0"), other.entry("2.0.0"))
    store = UnderlayStore(tmp_path / "cache", named_ros)
    with pytest.raises(UsageError, match=r"'arm' is in robots 1\.0\.0 and in others 2\.0\.0"):
        store.add([both], 20.0)
    lacking = repos(tmp_path, repository.entry("1.0.0", packages="[head]"))
    with pytest.raises(UsageError, match=r"robots 1\.0\.0 has no package 'head'"):
        store.add([lacking], 20.0)


def test_a_folder_without_a_package_is_refused(named_ros: RosInstallation, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty/notes.txt").write_text("none")
    with pytest.raises(UsageError, match=r"there is no package in it"):
        UnderlayStore(tmp_path / "cache", named_ros).add([find_underlay("empty", tmp_path)], 1.0)


@pytest.mark.ros
@pytest.mark.slow
def test_a_file_is_built_once_laid_under_submissions_and_removed(
    real_ros: RosInstallation, repository: Repository, tmp_path: Path
) -> None:
    commit = repository.commit("arm", "leg", tag="1.0.0")
    underlay = repos(tmp_path, repository.entry("1.0.0", commit=commit, packages="[arm]"))
    told: list[str] = []
    store = UnderlayStore(tmp_path / "cache", real_ros, told.append)
    assert store.add([underlay], 20.0) == ["course"]
    ((built, _),) = store.installed()
    assert built.packages == ("arm",)
    assert any("course: building arm (1 of 1" in line for line in told)
    assert store.add([underlay], 20.0) == []
    laid = store.lay([underlay])
    assert laid.packages - real_ros.packages == {"arm"}
    assert "arm" in laid.python_modules
    # Another folder with the same package cannot be laid beside it.
    folder = find_underlay("robots", tmp_path)
    with pytest.raises(UsageError, match=r"the package 'arm' is in two underlays"):
        store.lay([underlay, folder])
    assert store.kept.remove("course")
    assert store.missing([underlay])


@pytest.mark.ros
@pytest.mark.slow
def test_lists_of_one_name_in_two_courses_keep_their_builds(
    real_ros: RosInstallation, repository: Repository, tmp_path: Path
) -> None:
    repository.commit("arm", "leg", tag="1.0.0")
    arm, leg = (repository.entry("1.0.0", packages=f"[{name}]") for name in ("arm", "leg"))
    first, second = repos(tmp_path / "first", arm), repos(tmp_path / "second", leg)
    store = UnderlayStore(tmp_path / "cache", real_ros)
    for underlay in (first, second):
        assert store.add([underlay], 20.0) == ["course"]
    assert store.missing([first, second]) == []
    # The first course now takes what the second takes, and what it took before goes.
    changed = repos(tmp_path / "first", leg)
    assert store.add([changed], 20.0) == []
    assert store.missing([first, second, changed]) != []
    assert store.missing([second, changed]) == []
    # So it stays until none of them wants it.
    assert store.add([repos(tmp_path / "second", arm)], 20.0) == ["course"]
    assert store.missing([changed]) == []
    with pytest.raises(UsageError, match=f"remove {changed.place} or {second.place}"):
        store.kept.remove("course")
    assert store.kept.remove(changed.place)
    assert [one.packages for one, _ in store.installed()] == [("arm",)]


@pytest.mark.ros
@pytest.mark.slow
def test_a_package_that_does_not_build_is_named_with_its_reason_and_tried_again(
    real_ros: RosInstallation, repository: Repository, tmp_path: Path
) -> None:
    repository.commit("arm", tag="1.0.0")
    setup = repository.folder / "arm/setup.py"
    good = setup.read_text()
    setup.write_text("raise RuntimeError('no arms today')\n")
    store = UnderlayStore(tmp_path / "cache", real_ros)
    folder = find_underlay("robots", tmp_path)
    with pytest.raises(GraderFault, match=r"arm of robots could not be built: .*no arms today"):
        store.add([folder], 1.0)
    setup.write_text(good)
    assert store.add([folder], 1.0) == ["robots"]
