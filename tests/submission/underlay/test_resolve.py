"""The index says where packages are, and each package what it needs."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from grader.errors import GraderFault, UsageError
from grader.machine.ros import RosInstallation
from grader.submission.underlay.distribution import Distribution, Release, read_distribution
from grader.submission.underlay.resolve import closure, resolve
from tests.submission.underlay.conftest import Index, Repository

Get = Callable[[Release], Path]


@pytest.fixture
def get(index: Index, tmp_path: Path) -> Get:
    """The sources of releases, without rosgrade's own git."""

    def checked_out(release: Release) -> Path:
        assert release.source.url == index.releases.url
        folder = tmp_path / "checked out" / release.name
        if not folder.exists():
            index.releases.git("worktree", "add", "--quiet", str(folder), release.source.version)
        return folder

    return checked_out


def listed(index: Index) -> Distribution:
    index.write()
    return read_distribution(index.folder)


def test_what_a_package_needs_comes_before_it_and_what_ros_has_does_not(
    index: Index, get: Get, named_ros: RosInstallation
) -> None:
    index.add("base")
    index.add("driver", needs="<exec_depend>base</exec_depend>")
    index.add("robot", needs="<depend>driver</depend><test_depend>simulation</test_depend>")
    index.add("simulation")
    plan = resolve(["robot"], listed(index), named_ros, get)
    assert [one.release.name for one in plan] == ["base", "driver", "robot"]
    assert closure(["driver"], plan) == {"base", "driver"}
    (named_ros.prefixes[0] / "share/ament_index/resource_index/packages/driver").touch()
    fresh = RosInstallation("wheels", named_ros.python, named_ros.prefixes)
    assert [one.release.name for one in resolve(["robot"], listed(index), fresh, get)] == ["robot"]


def test_libraries_of_the_system_are_told_apart_by_when_they_are_needed(
    index: Index, get: Get, named_ros: RosInstallation
) -> None:
    index.add("robot", needs="<depend>eigen</depend><exec_depend>graphviz</exec_depend>")
    (robot,) = resolve(["robot"], listed(index), named_ros, get)
    assert (robot.build_keys, robot.run_keys) == ({"eigen"}, {"graphviz"})


# catkin_pkg calls pyparsing by names that its newer versions deprecate.
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_an_entry_for_another_ros_does_not_count(
    index: Index, get: Get, named_ros: RosInstallation
) -> None:
    index.add("robot", needs='<depend condition="$ROS_VERSION == 1">roscpp</depend>')
    (robot,) = resolve(["robot"], listed(index), named_ros, get)
    assert not robot.needs


def test_a_package_that_does_not_exist_is_told_the_nearest(
    index: Index, get: Get, named_ros: RosInstallation
) -> None:
    index.add("robot")
    with pytest.raises(UsageError, match=r"no package 'robt' .*Did you mean 'robot'\?"):
        resolve(["robt"], listed(index), named_ros, get)
    with pytest.raises(UsageError, match=r"'wheels' was not released .*\.repos file"):
        resolve(["wheels"], listed(index), named_ros, get)


def test_a_need_that_nobody_knows_is_told_with_who_has_it(
    index: Index, get: Get, named_ros: RosInstallation
) -> None:
    index.add("robot", needs="<depend>unobtainium</depend>")
    with pytest.raises(GraderFault, match=r"robot 1\.0\.0 needs 'unobtainium', which is neither"):
        resolve(["robot"], listed(index), named_ros, get)


def test_versions_that_contradict_each_other_are_refused(
    index: Index, get: Get, named_ros: RosInstallation
) -> None:
    index.add("base", "1.9.0")
    index.add("robot", needs='<depend version_gte="1.10.0">base</depend>')
    with pytest.raises(UsageError, match=r"needs base with version_gte='1\.10\.0', .* has 1\.9\.0"):
        resolve(["robot"], listed(index), named_ros, get)
    index.add("arm", needs='<depend version_lt="2.0.0">base</depend>')
    assert len(resolve(["arm"], listed(index), named_ros, get)) == 2


def test_packages_that_need_each_other_are_refused(
    index: Index, get: Get, named_ros: RosInstallation
) -> None:
    index.add("hen", needs="<depend>egg</depend>")
    index.add("egg", needs="<depend>hen</depend>")
    with pytest.raises(
        UsageError, match=r"because (egg needs hen needs egg|hen needs egg needs hen)"
    ):
        resolve(["egg"], listed(index), named_ros, get)


def test_a_release_that_holds_another_package_is_refused(
    index: Index, get: Get, named_ros: RosInstallation
) -> None:
    index.add("robot")
    index.releases.git("tag", "release/jazzy/arm/1.0.0-1")
    index.names["1.0.0"].append("arm")
    with pytest.raises(GraderFault, match="holds the package 'robot', where the index names 'arm'"):
        resolve(["arm"], listed(index), named_ros, get)


@pytest.mark.parametrize(
    ("file", "text", "told"),
    [
        ("index-v4.yaml", "distributions: {}\n", "index-v4.yaml: it does not name jazzy"),
        ("jazzy/distribution.yaml", "repositories: [\n", "jazzy/distribution.yaml: .*expected"),
        ("jazzy/distribution.yaml", "<html>", "jazzy/distribution.yaml: .*dictionary"),
        (
            "jazzy/distribution.yaml",
            "repositories: {arm: {release: {url: u, version: 1.0.0-1}}}",
            "jazzy/distribution.yaml: arm has no tag",
        ),
        ("rosdep/base.yaml", "eigen: [libeigen3-dev]\n", "rosdep/base.yaml: eigen: .*dictionary"),
    ],
)
def test_a_damaged_index_is_a_fault_with_its_file_and_the_way_out(
    index: Index, file: str, text: str, told: str
) -> None:
    index.write(**{file: text})
    with pytest.raises(GraderFault, match=rf"is damaged \({told}.*To fetch it again: rm -r"):
        read_distribution(index.folder)


def test_an_index_that_lost_a_file_is_damaged(index: Index) -> None:
    index.write()
    shutil.rmtree(index.folder / "rosdep")
    with pytest.raises(GraderFault, match=r"rosdep/base\.yaml: No such file"):
        read_distribution(index.folder)


def test_a_package_is_at_the_tag_of_its_release(tmp_path: Path) -> None:
    index = Index(tmp_path / "index", Repository(tmp_path / "releases"))
    index.add("arm", "2.3.4")
    arm = listed(index).release("arm")
    assert (arm.version, arm.source.version) == ("2.3.4", "release/jazzy/arm/2.3.4-1")
