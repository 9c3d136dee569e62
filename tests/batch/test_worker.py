"""A submission on its way to a worker and back: what arrives is what was handed in."""

from __future__ import annotations

import io
import os
import pickle
import tarfile
import zipfile
from pathlib import Path

import pytest

from grader.batch.worker import Parcel, unpack
from grader.errors import GraderFault
from grader.submission.prepare import fingerprint


@pytest.fixture
def submission(tmp_path: Path) -> Path:
    """A folder with a program, a link and leftovers of colcon."""
    package = tmp_path / "ana" / "src" / "pkg"
    package.mkdir(parents=True)
    (package / "package.xml").write_text("<package/>")
    (package / "node").write_text("#!/usr/bin/env python3\n")
    (package / "node").chmod(0o755)
    (package / "empty.py").touch()
    (package / "link.py").symlink_to("empty.py")
    (tmp_path / "ana" / "build").mkdir()
    return tmp_path / "ana"


def sent(path: Path, target: Path) -> Path:
    """What a worker finds."""
    parcel: Parcel = pickle.loads(pickle.dumps(Parcel.of("ana", path, {})))
    assert parcel.refused is None
    unpack(parcel.content, target)
    return target / parcel.name


def test_a_folder_arrives_with_the_hash_that_it_has_here(submission: Path, tmp_path: Path) -> None:
    arrived = sent(submission, tmp_path / "arrived")
    assert fingerprint(arrived) == fingerprint(submission)
    assert os.access(arrived / "src" / "pkg" / "node", os.X_OK)


def test_an_archive_arrives_as_it_is(submission: Path, tmp_path: Path) -> None:
    file = tmp_path / "ana.zip"
    with zipfile.ZipFile(file, "w") as archive:
        archive.write(submission / "src" / "pkg" / "package.xml", "pkg/package.xml")
    arrived = sent(file, tmp_path / "arrived")
    assert arrived.read_bytes() == file.read_bytes()


@pytest.mark.parametrize("kind", ["folder", "archive"])
def test_a_refused_submission_is_not_sent_but_only_its_reason(
    kind: str, submission: Path, tmp_path: Path
) -> None:
    path = submission if kind == "folder" else tmp_path / "ana.zip"
    with (submission / "big.bin" if kind == "folder" else path).open("wb") as big:
        big.truncate(2**30)
    parcel = Parcel.of("ana", path, {})
    assert parcel.content == b""
    assert parcel.refused is not None
    assert "256 MiB" in (parcel.refused.record.problem or "")
    assert parcel.refused.record.sha256 == fingerprint(path)


def test_a_tar_that_leads_out_is_refused(tmp_path: Path) -> None:
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w") as tar:
        link = tarfile.TarInfo("out")
        link.type, link.linkname = tarfile.SYMTYPE, "/etc"
        tar.addfile(link)
    target = tmp_path / "in"
    target.mkdir()
    with pytest.raises(GraderFault, match="outside its folder: out"):
        unpack(stream.getvalue(), target)
    assert not list(target.iterdir())
