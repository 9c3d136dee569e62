from __future__ import annotations

import bz2
import io
import lzma
import os
import struct
import tarfile
import zipfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grader.errors import GraderFault, SubmissionError
from grader.submission.intake.archive import unpack
from grader.submission.intake.leftovers import is_left_out
from grader.submission.intake.locate import opened
from grader.submission.intake.members import ArchiveLimits
from tests.submission.samples import tar_bytes, tar_member, zip_bytes

MIB = 2**20


def listdir(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def unpacked(tmp_path: Path, content: bytes, name: str = "bot.zip") -> dict[str, bytes]:
    """Unpack an archive; its files: path -> content."""
    archive, into = tmp_path / name, tmp_path / "into"
    archive.write_bytes(content)
    into.mkdir()
    unpack(archive, into)
    assert listdir(tmp_path) == sorted([name, "into"])
    return {
        path.relative_to(into).as_posix(): path.read_bytes()
        for path in into.rglob("*")
        if path.is_file()
    }


def refusal(tmp_path: Path, content: bytes, limits: ArchiveLimits | None = None) -> str:
    """Why an archive is refused; nothing may have been written beside its folder."""
    archive, into = tmp_path / "bot.zip", tmp_path / "into"
    archive.write_bytes(content)
    into.mkdir()
    with pytest.raises(SubmissionError, match=r"^bot\.zip: ") as caught:
        unpack(archive, into, limits)
    assert listdir(tmp_path) == ["bot.zip", "into"]
    return str(caught.value)


def test_the_content_decides_not_the_suffix(tmp_path: Path) -> None:
    content = tar_bytes(tar_member("b.py", b"x = 1\n"))
    assert unpacked(tmp_path, content, "bot (1).zip") == {"b.py": b"x = 1\n"}


def test_only_the_executable_bit_is_kept(tmp_path: Path) -> None:
    content = tar_bytes(tar_member("run", b"#!", mode=0o6755), tar_member("data", b"", mode=0o1666))
    unpacked(tmp_path, content)
    assert (tmp_path / "into/run").stat().st_mode & 0o7700 == 0o700
    assert (tmp_path / "into/data").stat().st_mode & 0o7700 == 0o600


def test_a_zip_made_on_windows_has_its_folders(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        info = zipfile.ZipInfo("src/bot/package.xml")
        info.create_system = 0
        archive.writestr(info, b"<package/>")
    content = buffer.getvalue().replace(b"src/bot/package.xml", b"src\\bot\\package.xml")
    assert unpacked(tmp_path, content) == {"src/bot/package.xml": b"<package/>"}


def test_a_name_in_utf_8_that_is_not_marked_as_such_is_read(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("gr__e.py", b"")
    content = buffer.getvalue().replace(b"gr__e.py", "größe.py".encode()[:4] + b"e.py")
    assert list(unpacked(tmp_path, content)) == ["gröe.py"]


def test_links_that_stay_inside_are_made(tmp_path: Path) -> None:
    content = tar_bytes(
        tar_member("bot/link.py", type=tarfile.SYMTYPE, linkname="node.py"),
        tar_member("bot/node.py", b"x"),
        tar_member("same.py", type=tarfile.LNKTYPE, linkname="bot/node.py"),
    )
    assert unpacked(tmp_path, content, "b.tar.gz") == dict.fromkeys(
        ("bot/link.py", "bot/node.py", "same.py"), b"x"
    )
    assert (tmp_path / "into/bot/link.py").is_symlink()


@pytest.mark.parametrize("name", ["../evil.py", "/tmp/evil.py", "a/../../evil.py"])
def test_paths_out_of_a_zip_and_a_tar_are_refused(tmp_path: Path, name: str) -> None:
    for number, content in enumerate((zip_bytes((name, b"x")), tar_bytes(tar_member(name, b"x")))):
        folder = tmp_path / str(number)
        folder.mkdir()
        assert "refused" in refusal(folder, content)


def test_a_nul_in_a_name_is_refused(tmp_path: Path) -> None:
    content = zip_bytes(("a_b.py", b"")).replace(b"a_b.py", b"a\0b.py")
    assert "NUL" in refusal(tmp_path, content)


@pytest.mark.parametrize(
    "fields",
    [
        {"type": tarfile.LNKTYPE, "linkname": "/etc/passwd"},
        {"type": tarfile.FIFOTYPE},
        {"type": tarfile.CHRTYPE, "devmajor": 1, "devminor": 3},
        {"type": tarfile.BLKTYPE},
    ],
)
def test_hard_links_out_devices_and_pipes_are_refused(
    tmp_path: Path, fields: dict[str, object]
) -> None:
    refusal(tmp_path, tar_bytes(tar_member("x", **fields)))
    assert not listdir(tmp_path / "into")


def test_a_file_below_a_link_is_refused(tmp_path: Path) -> None:
    content = tar_bytes(
        tar_member("d", type=tarfile.SYMTYPE, linkname="."), tar_member("d/evil", b"x")
    )
    assert "not a folder" in refusal(tmp_path, content)


@pytest.mark.parametrize("mode", ["zip", "w:gz", "w:bz2", "w:xz"])
def test_a_bomb_is_refused_before_it_is_written(tmp_path: Path, mode: str) -> None:
    zeros = b"\0" * (40 * MIB)
    tar = mode != "zip" and tar_bytes(tar_member("zeros", zeros), mode=mode)
    assert "times its size" in refusal(tmp_path, tar or zip_bytes(("zeros", zeros)))
    assert not listdir(tmp_path / "into")


def test_a_zip_that_lies_about_a_size_is_refused(tmp_path: Path) -> None:
    content = bytearray(zip_bytes(("zeros", b"\0" * 100_000)))
    for mark, offset in ((b"PK\x03\x04", 22), (b"PK\x01\x02", 24)):
        struct.pack_into("<I", content, content.index(mark) + offset, 10)
    assert "broken" in refusal(tmp_path, bytes(content))


@pytest.mark.parametrize(
    "content",
    [
        tar_bytes(*(tar_member(str(number)) for number in range(30))),
        zip_bytes(*((str(number), b"") for number in range(30))),
    ],
    ids=["tar", "zip"],
)
def test_many_small_files_are_refused(tmp_path: Path, content: bytes) -> None:
    assert "2 members" in refusal(tmp_path, content, ArchiveLimits(members=2))


def test_a_large_archive_is_refused_before_it_is_opened(tmp_path: Path) -> None:
    content = zip_bytes(("noise", os.urandom(MIB)))
    assert "larger than" in refusal(tmp_path, content, ArchiveLimits(total_bytes=MIB // 2))


def test_an_encrypted_zip_is_refused(tmp_path: Path) -> None:
    content = bytearray(zip_bytes(("a.py", b"x")))
    for mark, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        content[content.index(mark) + offset] |= 1
    assert "a.py: is encrypted" in refusal(tmp_path, bytes(content))


def test_a_rare_compression_is_refused(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_LZMA) as archive:
        archive.writestr("a.py", b"x" * 1000)
    assert "rare compression method" in refusal(tmp_path, buffer.getvalue())


# The second one is read by old Pythons in quadratic time.
@pytest.mark.parametrize("comment", ["c" * 100_000, "1" * 60_000], ids=["long", "digits"])
def test_a_header_that_is_no_name_is_refused(tmp_path: Path, comment: str) -> None:
    content = tar_bytes(tar_member("x", pax_headers={"comment": comment}), mode="w")
    assert "header" in refusal(tmp_path, content)


@pytest.mark.parametrize("mode", ["w", "w:gz", "w:xz"])
def test_a_tar_that_ends_too_early_is_refused(tmp_path: Path, mode: str) -> None:
    content = tar_bytes(tar_member("a", os.urandom(50_000)), mode=mode)
    assert "broken" in refusal(tmp_path, content[: len(content) // 2])


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "is empty"),
        (b"import rclpy\n", "neither a folder nor a .zip"),
        (b"Rar!\x1a\x07\x00", "neither a folder nor a .zip or .tar.gz archive"),
        (b"PK\x03\x04", "broken"),
        (b"\x1f\x8b\x08", "broken"),
        (b"\xfd7zXZ\x00", "broken"),
        (b"BZh9", "broken"),
    ],
)
def test_a_file_that_is_no_archive_is_refused_as_such(
    tmp_path: Path, content: bytes, reason: str
) -> None:
    assert reason in refusal(tmp_path, content)


NAMES = st.text(
    st.characters(blacklist_categories=["Cs"], blacklist_characters="/\0\\"),
    min_size=1,
    max_size=20,
).filter(lambda name: name not in (".", "..") and not is_left_out(name))


def test_an_archive_that_cannot_be_unpacked_here_is_no_fault_of_the_student(
    tmp_path: Path,
) -> None:
    (tmp_path / "a.zip").write_bytes(zip_bytes(("a.py", b"")))
    (tmp_path / "into").touch()
    with pytest.raises(GraderFault, match="could not be unpacked here"):
        unpack(tmp_path / "a.zip", tmp_path / "into")


TREES = st.dictionaries(NAMES, st.binary(max_size=200), max_size=6)


@settings(deadline=None, max_examples=40)
@given(TREES, st.sampled_from(["w", "w:gz", "w:bz2", "w:xz", "zip"]))
def test_what_was_packed_is_unpacked(
    tmp_path_factory: pytest.TempPathFactory, files: dict[str, bytes], mode: str
) -> None:
    if mode == "zip":
        content = zip_bytes(*((f"top/{name}", data) for name, data in files.items()))
    else:
        content = tar_bytes(*(tar_member(f"top/{n}", d) for n, d in files.items()), mode=mode)
    found = unpacked(tmp_path_factory.mktemp("tree"), content, "bot.tar")
    assert found == {f"top/{name}": data for name, data in files.items()}


DAMAGE = st.lists(st.tuples(st.integers(0, 10_000), st.integers(0, 255)), min_size=1, max_size=8)
ZIP = zip_bytes(("a/b.py", b"x = 1\n" * 50), ("c", b"d"), ("link", b"c"))
TAR = tar_bytes(
    tar_member("a/b.py", b"x = 1\n" * 50),
    tar_member("l", type=tarfile.SYMTYPE, linkname="a"),
    tar_member("ü" * 120, b"y", pax_headers={"comment": "z"}),
    mode="w",
)


@settings(deadline=None, max_examples=150)
@given(st.sampled_from([ZIP, TAR, bz2.compress(TAR), lzma.compress(TAR)]), DAMAGE)
def test_a_damaged_archive_is_unpacked_or_refused_and_nothing_else(
    tmp_path_factory: pytest.TempPathFactory, good: bytes, damage: list[tuple[int, int]]
) -> None:
    content = bytearray(good)
    for place, value in damage:
        content[place % len(content)] = value
    folder = tmp_path_factory.mktemp("damaged")
    (folder / "bot.zip").write_bytes(bytes(content))
    try:
        with opened(folder / "bot.zip") as located:
            root = located.root.resolve()
            assert all(path.resolve().is_relative_to(root) for path in root.rglob("*"))
    except SubmissionError:
        pass
    assert listdir(folder) == ["bot.zip"]
