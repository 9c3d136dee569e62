"""What is read of the files beside packages: leftovers, headings, bags."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import zstandard

from grader.machine.ros import find as find_ros
from grader.recording.submission import BagRecord
from grader.sandbox.limits import BUILD, MIB
from grader.sandbox.sandbox import Sandbox
from grader.submission.intake.locate import opened
from grader.submission.prepare import Preparation, prepare
from grader.submission.read import reader
from grader.submission.read.bag import read_bags
from grader.submission.read.document import headings
from tests.submission.samples import zip_bytes

MADE = {
    "ws/src/bot/package.xml": "<package/>",
    "ws/src/bot/log/__init__.py": "",
    "ws/src/bot/log/__pycache__/x.pyc": "",
    "ws/build/COLCON_IGNORE": "",
    "ws/build/bot/setup.py": "",
    "ws/.git/config": "",
    "ws/src/pub/package.xml": "<package/>",
    "ws/src/pub/build/CMakeCache.txt": "",
    "ws/src/pub/build/pub": "",
    "ws/src/pub/CMakeFiles/pub.dir/pub.cpp.o": "",
}


def zipped(files: dict[str, str]) -> bytes:
    return zip_bytes(*((name, text.encode()) for name, text in files.items()))


def test_what_builds_and_runs_made_is_known_of_a_folder_and_of_an_archive(tmp_path: Path) -> None:
    for name, text in MADE.items():
        path = tmp_path / "handed" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    (tmp_path / "a.zip").write_bytes(zipped(MADE))
    for source in (tmp_path / "handed", tmp_path / "a.zip"):
        with opened(source) as located:
            assert located.leftovers == (
                *("ws/build", "ws/src/bot/log/__pycache__"),
                *("ws/src/pub/CMakeFiles", "ws/src/pub/build"),
            )


def test_archives_that_differ_only_in_leftovers_are_two_submissions(tmp_path: Path) -> None:
    clean = {name: text for name, text in MADE.items() if "build" not in name}
    hashes = set()
    for name, files in (("a.zip", MADE), ("b.zip", clean)):
        (tmp_path / name).write_bytes(zipped(files))
        with opened(tmp_path / name) as located:
            hashes.add(located.sha256)
    assert len(hashes) == 2


def test_headings_of_markdown_and_restructuredtext() -> None:
    text = "# Bot #\r\n\n```sh\n# no heading\n```\n## Usage\n\nDesign\n======\n\nTests\n-----\n"
    assert headings(text) == ("Bot", "Usage", "Design", "Tests")


@pytest.mark.parametrize("plugin", ["MCAP", "SQLITE3"])
def test_a_recorded_bag_is_read_to_its_end(tmp_path: Path, plugin: str) -> None:
    record = read(write_bag(tmp_path / "submission", plugin))
    assert record.problem is None
    assert record.duration_s == pytest.approx(2.0)
    assert [(one.name, one.type, one.messages) for one in record.topics] == [
        ("/chatter", "std_msgs/msg/String", 3)
    ]


def test_a_damaged_bag_says_so(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "submission", "SQLITE3")
    storage = next(bag.glob("*.db3"))
    storage.write_bytes(storage.read_bytes()[:4000])
    assert "cannot be read" in str(read(bag).problem)


def test_a_bag_whose_recording_did_not_end_says_so(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "submission", "MCAP")
    (bag / "metadata.yaml").unlink()
    assert "no metadata.yaml" in str(read(bag).problem)


@pytest.mark.parametrize("isolated", [True, False], ids=["sandbox", "none"])
def test_a_bag_that_unpacks_to_more_than_a_disk_fills_none(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch, isolated: bool
) -> None:
    elsewhere = tmp_path / "tmp"
    elsewhere.mkdir()
    monkeypatch.setenv("TMPDIR", str(elsewhere))
    monkeypatch.setattr(reader, "BUILD", replace(BUILD, disk_bytes=8 * MIB, file_bytes=8 * MIB))
    bag = packed_bag(tmp_path / "submission", 64 * MIB)
    record = read(bag, Sandbox(cache) if isolated else None)
    assert "cannot be read" in str(record.problem)
    assert not list(elsewhere.iterdir())


def test_a_bag_is_read_only_where_a_check_asks_for_it(tmp_path: Path) -> None:
    write_bag(tmp_path / "submission", "MCAP")
    for asked in (True, False):
        record = prepare(
            tmp_path / "submission",
            Preparation(ros=find_ros(), cache=tmp_path / "cache", with_bags=asked),
        ).record
        assert (record.bags is not None) is asked


def read(bag: Path, sandbox: Sandbox | None = None) -> BagRecord:
    with opened(bag.parent) as located:
        (found,) = read_bags(located, find_ros(), sandbox)
    return found.record


def packed_bag(root: Path, size: int) -> Path:
    """A bag with one file that zstd packed into next to nothing."""
    bag = write_bag(root, "SQLITE3")
    storage = next(bag.glob("*.db3"))
    packed = zstandard.ZstdCompressor().compress(bytes(size))
    storage.with_name(f"{storage.name}.zstd").write_bytes(packed)
    storage.unlink()
    metadata = bag / "metadata.yaml"
    text = metadata.read_text().replace(storage.name, f"{storage.name}.zstd")
    text = text.replace("compression_format: ''", "compression_format: zstd")
    text = text.replace("compression_mode: ''", "compression_mode: FILE")
    metadata.write_text(text)
    return bag


def write_bag(root: Path, plugin: str) -> Path:
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    root.mkdir(exist_ok=True)
    store = get_typestore(Stores.ROS2_JAZZY)
    kind = "std_msgs/msg/String"
    with Writer(root / "bag", version=9, storage_plugin=StoragePlugin[plugin]) as writer:
        connection = writer.add_connection("/chatter", kind, typestore=store)
        for second in range(3):
            data = store.serialize_cdr(store.types[kind](data="hello"), kind)
            writer.write(connection, second * 10**9, bytes(data))
    return root / "bag"
