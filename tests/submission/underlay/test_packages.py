"""Packages of ROS 2 are built by their names, each once for all that need it."""

from __future__ import annotations

from pathlib import Path

import pytest

from grader.errors import GraderFault, UsageError
from grader.machine.ros import RosInstallation
from grader.submission.underlay import packages
from grader.submission.underlay.definition import Underlay, find_underlay
from grader.submission.underlay.store import MissingUnderlay, UnderlayStore
from grader.submission.underlay.system_libraries import System
from tests.submission.underlay.conftest import Index, Repository


def named(*names: str) -> list[Underlay]:
    return [Underlay(name, name, (name,)) for name in names]


def test_libraries_of_the_system_are_asked_for_before_anything_is_built(
    index: Index, named_ros: RosInstallation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    index.add("base")
    index.add("eye", needs="<depend>base</depend><depend>eigen</depend>")
    index.add("map", needs="<depend>base</depend><depend>graphviz</depend>")
    index.pin(monkeypatch)
    bare = System("debian", "bookworm", frozenset())
    monkeypatch.setattr(packages, "this_system", lambda: bare)
    told: list[str] = []
    store = UnderlayStore(tmp_path / "cache", named_ros, told.append)
    with pytest.raises(GraderFault, match=r"eye, map .*: sudo apt install graphviz libeigen3-dev$"):
        store.add(named("eye", "map"), 20.0)
    assert not any("building" in line for line in told)
    assert "packages of ROS 2 Jazzy as of 2025-01-01" in told


def test_an_index_that_cannot_be_reached_is_a_fault_of_ours(
    index: Index, named_ros: RosInstallation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    index.pin(monkeypatch)
    index.folder.rename(tmp_path / "gone")
    store = UnderlayStore(tmp_path / "cache", named_ros)
    with pytest.raises(GraderFault, match=r"the index of ROS 2: git ls-remote failed"):
        store.add(named("arm"), 20.0)


def test_an_index_that_was_changed_under_its_tag_is_refused(
    index: Index, named_ros: RosInstallation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    index.pin(monkeypatch)
    index.git("commit", "--quiet", "--allow-empty", "--message", "other")
    index.git("tag", "--force", "jazzy/2025-01-01")
    store = UnderlayStore(tmp_path / "cache", named_ros)
    with pytest.raises(UsageError, match=r"the tag jazzy/2025-01-01 .* was moved"):
        store.add(named("arm"), 20.0)


@pytest.mark.ros
@pytest.mark.slow
def test_what_two_names_need_is_built_once_and_stays_until_neither_needs_it(
    index: Index, real_ros: RosInstallation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    index.add("base")
    index.add("arm", needs="<depend>base</depend>")
    index.add("leg", needs="<depend>base</depend>")
    index.pin(monkeypatch)
    told: list[str] = []
    store = UnderlayStore(tmp_path / "cache", real_ros, told.append)
    assert store.add(named("arm"), 20.0) == ["base", "arm"]
    assert "building arm (2 of 2, once on this machine)" in told
    assert store.add(named("leg"), 20.0) == ["leg"]
    assert store.add(named("arm", "leg"), 20.0) == []
    arm, leg = named("arm", "leg")
    laid = store.lay([arm, leg])
    assert laid.packages - real_ros.packages == {"base", "arm", "leg"}
    assert len(laid.underlays) == 3
    # Each stands before what it needs, as after sourcing one workspace on top of another.
    assert [path.parent for path in laid.underlays].index(store.packages.built()["base"][1].parent)
    with pytest.raises(UsageError, match="'base' is here because of arm, leg: remove that"):
        store.kept.remove("base")
    assert store.kept.remove("arm")
    assert [one.name for one, _ in store.installed()] == ["base", "leg"]
    assert store.missing([leg]) == []
    assert store.missing([arm]) == [arm]
    assert store.kept.remove("leg")
    assert store.installed() == []


@pytest.mark.ros
@pytest.mark.slow
def test_what_was_built_stays_when_a_later_package_fails(
    index: Index, real_ros: RosInstallation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    index.add("base")
    index.add("arm", needs="<depend>base</depend>")
    setup = index.releases.folder / "setup.py"
    setup.write_text("raise RuntimeError('no arms today')\n")
    index.releases.git("commit", "--quiet", "--all", "--message", "broken")
    index.releases.git("tag", "--force", "release/jazzy/arm/1.0.0-1")
    index.pin(monkeypatch)
    told: list[str] = []
    store = UnderlayStore(tmp_path / "cache", real_ros, told.append)
    for _ in range(2):
        with pytest.raises(GraderFault, match=r"arm could not be built: .*no arms today"):
            store.add(named("arm"), 20.0)
    assert [one.name for one, _ in store.installed()] == ["base"]
    assert sum(line.startswith("building base") for line in told) == 1
    with pytest.raises(MissingUnderlay, match="rosgrade underlay add arm"):
        store.lay(named("arm"))


@pytest.mark.ros
@pytest.mark.slow
def test_a_submission_gets_by_need_what_it_names_and_is_built(
    index: Index, real_ros: RosInstallation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    index.add("base")
    index.add("arm", needs="<depend>base</depend>")
    index.pin(monkeypatch)
    store = UnderlayStore(tmp_path / "cache", real_ros)
    assert store.needed(real_ros, {"arm"}) == real_ros
    store.add(named("arm"), 20.0)
    assert store.needed(real_ros, {"leg"}) == real_ros
    assert store.needed(real_ros, {"arm"}).packages - real_ros.packages == {"arm", "base"}
    # Another day of the index is another version, until it is added.
    index.pin(monkeypatch, "jazzy/2025-02-02")
    assert store.needed(real_ros, {"arm"}) == real_ros
    assert store.add(named("arm"), 20.0) == []
    assert store.needed(real_ros, {"arm"}).packages - real_ros.packages == {"arm", "base"}


@pytest.mark.ros
@pytest.mark.slow
def test_a_list_of_a_course_is_built_on_packages_of_ros(
    index: Index, real_ros: RosInstallation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    index.add("base")
    index.pin(monkeypatch)
    robots = Repository(tmp_path / "robots")
    robots.commit("arm", tag="1.0.0")
    entry = robots.entry("1.0.0", packages="[arm]")
    (tmp_path / "course.repos").write_text(f"repositories:\n{entry}requires: [base]\n")
    course = find_underlay("course.repos", tmp_path)
    store = UnderlayStore(tmp_path / "cache", real_ros)
    with pytest.raises(MissingUnderlay, match=r"rosgrade underlay add .*course\.repos"):
        store.lay([course])
    assert store.add([course], 20.0) == ["base", "course"]
    assert store.lay([course]).packages - real_ros.packages == {"arm", "base"}
