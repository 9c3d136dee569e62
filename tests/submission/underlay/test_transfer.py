"""What was built once is carried to machines of the same kind, and refused by others."""

from __future__ import annotations

import hashlib
import io
import json
import tarfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from grader.errors import UsageError
from grader.machine.ros import RosInstallation
from grader.submission.underlay import portable, transfer
from grader.submission.underlay.building import digest
from grader.submission.underlay.distribution import SNAPSHOT
from grader.submission.underlay.kept import Installed
from grader.submission.underlay.store import UnderlayStore

Machine = Callable[[str], UnderlayStore]
Change = Callable[[dict[str, Any]], None]


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    """Machines of one kind, with ROS in different places."""

    def made(name: str) -> UnderlayStore:
        prefix = tmp_path / name / "venv"
        (prefix / "share/ament_index/resource_index/packages").mkdir(parents=True, exist_ok=True)
        ros = RosInstallation("wheels", prefix / "bin/python", (prefix,))
        return UnderlayStore(tmp_path / name / "cache", ros)

    return made


def built(store: UnderlayStore, name: str, *needs: str, place: str = "") -> Path:
    """A package as if it had been built; its install space."""
    ros = store.packages.ros
    install = store.kept.install(f"key-of-{name}")
    (install / "share" / name).mkdir(parents=True)
    (install / "share" / name / "config.cmake").write_text(f"set(prefix {ros.prefixes[0]}/lib)\n")
    index = install / "share/ament_index/resource_index/packages"
    index.mkdir(parents=True)
    (index / name).touch()
    (install / "lib").mkdir()
    (install / "lib" / f"lib{name}.so.1").write_bytes(b"\0elf " + str(ros.prefixes[0]).encode())
    (install / "lib" / f"lib{name}.so").symlink_to(f"lib{name}.so.1")
    note = Installed(name, "", (name,), (place or name,), SNAPSHOT.version, "1.0.0")
    note = replace(note, installation=digest(ros), commit="c0ffee", needs=needs)
    store.kept.note(f"key-of-{name}", note)
    return install


@pytest.fixture
def archive(machine: Machine, tmp_path: Path) -> Path:
    """Two packages of another machine."""
    store = machine("teacher")
    built(store, "base", place="robot")
    built(store, "robot", "base")
    built(store, "other")
    file = tmp_path / "underlays.tar.gz"
    assert transfer.export(store.packages, ["robot"], file) == ["base", "robot"]
    assert not list(tmp_path.glob(".*"))
    return file


def test_what_was_built_on_one_machine_is_there_on_another_in_its_own_places(
    machine: Machine, archive: Path
) -> None:
    student = machine("student")
    assert transfer.bring(student.packages, str(archive)) == ["base", "robot"]
    laid = student.needed(student.packages.ros, {"robot"})
    assert laid.packages == {"base", "robot"}
    install = laid.underlays[0]
    prefix = student.packages.ros.prefixes[0]
    assert (install / "share/robot/config.cmake").read_text() == f"set(prefix {prefix}/lib)\n"
    # A program is not text: it stays as it was linked.
    assert b"teacher" in (install / "lib/librobot.so").read_bytes()
    assert (install / "lib/librobot.so").is_symlink()
    assert transfer.bring(student.packages, str(archive)) == []
    assert student.kept.remove("robot")
    assert student.installed() == []
    assert transfer.bring(student.packages, str(archive)) == ["base", "robot"]


def test_what_is_not_built_cannot_be_written(machine: Machine, tmp_path: Path) -> None:
    store = machine("teacher")
    built(store, "robot", "base")
    for names in (["arm"], ["robot"], []):
        with pytest.raises(UsageError, match="first run: rosgrade underlay add"):
            transfer.export(store.packages, names, tmp_path / "underlays.tar.gz")
    assert not (tmp_path / "underlays.tar.gz").exists()


@pytest.mark.parametrize(
    ("kind", "told"),
    [
        ({"machine": "aarch64"}, r"it is for another processor, aarch64, and here is \w+"),
        (
            {"system": "ubuntu noble glibc-2.39"},
            r"it is for another system, ubuntu noble glibc",
        ),
        ({"python": "3.9"}, r"it is for another Python, 3.9, and here is 3\.1"),
        (
            {"ros": ["ros_rcl-9.9.9.dist-info"]},
            r"it is for another ROS, ros_rcl-9.9.9.dist-info, and here is none",
        ),
    ],
)
def test_another_kind_of_machine_is_told_in_what_it_differs(
    machine: Machine, archive: Path, tmp_path: Path, kind: dict[str, Any], told: str
) -> None:
    changed = rewritten(archive, tmp_path, lambda contents: contents["kind"].update(kind))
    with pytest.raises(UsageError, match=f"cannot be used on this machine: {told}"):
        transfer.bring(machine("student").packages, str(changed))


def rewritten(archive: Path, folder: Path, change: Change) -> Path:
    """The archive with another underlays.json."""
    file = folder / "changed.tar.gz"
    with tarfile.open(archive) as old, tarfile.open(file, "w:gz") as new:
        for member in old:
            content = old.extractfile(member)
            data = content.read() if content else b""
            if member.name == portable.MANIFEST:
                contents = json.loads(data)
                change(contents)
                data = json.dumps(contents).encode()
                member.size = len(data)
            new.addfile(member, io.BytesIO(data))
    return file


def _other_form(contents: dict[str, Any]) -> None:
    contents["form"] = 99


def _outside(contents: dict[str, Any]) -> None:
    contents["packages"][0]["note"]["name"] = "../../etc"


def _other_day(contents: dict[str, Any]) -> None:
    contents["packages"][0]["note"]["snapshot"] = "jazzy/2020-01-01"


def _other_files(contents: dict[str, Any]) -> None:
    contents["packages"][1]["sha256"] = "0" * 64


def _without_need(contents: dict[str, Any]) -> None:
    del contents["packages"][0]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (_other_form, "was written by another version of rosgrade"),
        (_outside, "is damaged at '../../etc'"),
        (_other_day, "was made with another day of the index"),
        (_other_files, "the files of 'robot' are damaged"),
        (_without_need, "is damaged at 'robot'"),
        (dict.clear, "is not an archive of `rosgrade underlay export`"),
    ],
)
def test_what_does_not_fit_together_is_refused_as_a_whole(
    machine: Machine, archive: Path, tmp_path: Path, change: Change, told: str
) -> None:
    student = machine("student")
    with pytest.raises(UsageError, match=told):
        transfer.bring(student.packages, str(rewritten(archive, tmp_path, change)))
    assert student.installed() == []


def hostile(archive: Path, folder: Path, member: tarfile.TarInfo, data: bytes = b"") -> Path:
    """The archive with one more member."""
    file = folder / "hostile.tar.gz"
    with tarfile.open(archive) as old, tarfile.open(file, "w:gz") as new:
        for one in old:
            new.addfile(one, old.extractfile(one))
        member.size = len(data)
        new.addfile(member, io.BytesIO(data))
    return file


@pytest.mark.parametrize(
    ("name", "kind", "target", "told"),
    [
        ("../outside", tarfile.REGTYPE, "", r"paths with '\.\.' are refused"),
        ("/etc/outside", tarfile.REGTYPE, "", "absolute paths are refused"),
        ("robot/device", tarfile.CHRTYPE, "", "a device, pipe or other special file is refused"),
        ("robot/pipe", tarfile.FIFOTYPE, "", "a device, pipe or other special file is refused"),
        ("robot/link", tarfile.SYMTYPE, "/etc/passwd", "robot/link: leads outside"),
        ("robot/link", tarfile.SYMTYPE, "../base/share", "robot/link: leads outside"),
        ("robot/more", tarfile.REGTYPE, "", "the files of 'robot' are damaged"),
    ],
)
def test_a_hostile_archive_is_refused_and_leaves_nothing(
    machine: Machine, archive: Path, tmp_path: Path, name: str, kind: bytes, target: str, told: str
) -> None:
    member = tarfile.TarInfo(name)
    member.type, member.linkname = kind, target
    student = machine("student")
    with pytest.raises(UsageError, match=told):
        transfer.bring(student.packages, str(hostile(archive, tmp_path, member)))
    assert student.installed() == []
    assert not (tmp_path / "outside").exists()


def test_an_archive_that_unpacks_to_much_more_is_refused(
    machine: Machine, archive: Path, tmp_path: Path
) -> None:
    bomb = hostile(archive, tmp_path, tarfile.TarInfo("robot/zeros"), bytes(64 * 2**20))
    with pytest.raises(UsageError, match="times its size"):
        transfer.bring(machine("student").packages, str(bomb))


def test_a_file_that_is_no_archive_is_told_so(machine: Machine, tmp_path: Path) -> None:
    file = tmp_path / "notes.tar.gz"
    with pytest.raises(UsageError, match="there is no such file"):
        transfer.bring(machine("student").packages, str(file))
    file.write_text("tomorrow")
    with pytest.raises(UsageError, match=r"notes\.tar\.gz: is neither a folder nor"):
        transfer.bring(machine("student").packages, str(file))


def test_a_hash_that_is_asked_for_is_compared_before_anything_is_unpacked(
    machine: Machine, archive: Path
) -> None:
    store = machine("student")
    right = hashlib.sha256(archive.read_bytes()).hexdigest()
    with pytest.raises(UsageError, match=f"its hash is {right}"):
        transfer.bring(store.packages, f"{archive}#sha256={'0' * 64}")
    assert transfer.bring(store.packages, f"{archive}#sha256={right}") == ["base", "robot"]


@pytest.mark.parametrize(
    "place", ["https://example.org/u.tar.gz", "http://example.org/u.tar.gz#sha256=" + "0" * 64]
)
def test_a_download_has_to_be_secure_and_named_with_its_hash(machine: Machine, place: str) -> None:
    with pytest.raises(UsageError, match=r"write https://ADDRESS#sha256=HASH"):
        transfer.bring(machine("student").packages, place)


def test_a_download_that_is_there_already_is_not_fetched_again(
    machine: Machine, archive: Path
) -> None:
    store = machine("student")
    transfer.bring(store.packages, str(archive))
    right = hashlib.sha256(archive.read_bytes()).hexdigest()
    assert transfer.bring(store.packages, f"https://nowhere.invalid/u.tar.gz#sha256={right}") == []
