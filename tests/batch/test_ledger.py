"""The folder of a batch: a result is there as a whole or not at all."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from grader.batch.ledger import BATCH_FILE, BatchRows, Entry, Ledger
from grader.errors import UsageError
from grader.report.files import folder_name


@given(st.sets(st.text(min_size=1, max_size=300), min_size=2, max_size=5))
@example({".", "..", "...", "%2E", "a/b", "../x"})
def test_every_key_has_a_folder_of_its_own(keys: set[str]) -> None:
    names = {folder_name(key) for key in keys}
    assert len(names) == len(keys)
    for name in names:
        assert name not in (".", "..") and "/" not in name and name.isascii() and name.isprintable()
        assert 0 < len(name) <= 255


def test_what_an_interrupted_batch_left_half_is_removed(tmp_path: Path) -> None:
    ledger = Ledger(tmp_path / "out")
    with ledger.opened():
        kept = ledger.partial("ana")
        (kept / "report.html").write_text("whole")
        ledger.put("ana", kept)
        half = ledger.partial("ben")
        (half / "report.html").write_text("ha")
        (tmp_path / "out" / BATCH_FILE).touch()
    with ledger.opened():
        assert (ledger.folder("ana") / "report.html").read_text() == "whole"
        assert not ledger.folder("ben").exists()
        assert not half.exists()


def test_a_grade_that_is_replaced_is_kept_beside_the_new_one(tmp_path: Path) -> None:
    ledger = Ledger(tmp_path / "out")
    with ledger.opened():
        for text in ("first", "second", "third"):
            partial = ledger.partial("ana")
            (partial / "result.json").write_text(text)
            ledger.put("ana", partial)
    folder = ledger.folder("ana")
    assert (folder / "result.json").read_text() == "third"
    earlier = sorted((folder / "earlier").iterdir())
    assert [file.read_text() for file in earlier] == ["first", "second"]


def test_a_grade_that_was_about_to_be_replaced_is_put_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ledger = Ledger(tmp_path / "out")
    with ledger.opened():
        for text in ("first", "second"):
            partial = ledger.partial("ana")
            (partial / "result.json").write_text(text)
            ledger.put("ana", partial)
    rename, killed = Path.rename, tmp_path / "killed"

    def kill(path: Path, target: Path) -> Path:
        # All that is there is kept as a kill -9 would leave it, with the result out of its place.
        if target == ledger.folder("ana"):
            shutil.copytree(ledger.out, killed)
        return rename(path, target)

    with ledger.opened(), monkeypatch.context() as patched:
        partial = ledger.partial("ana")
        (partial / "result.json").write_text("third")
        patched.setattr(Path, "rename", kill)
        ledger.put("ana", partial)
    found = Ledger(killed)
    assert not found.folder("ana").exists()
    with found.opened():
        assert (found.folder("ana") / "result.json").read_text() == "second"
        earlier = {file.read_text() for file in (found.folder("ana") / "earlier").iterdir()}
        assert "first" in earlier


def test_two_batches_do_not_write_to_one_folder(tmp_path: Path) -> None:
    with (
        Ledger(tmp_path / "out").opened(),
        pytest.raises(UsageError, match="another batch is writing to it"),
        Ledger(tmp_path / "out").opened(),
    ):
        pass


def test_a_folder_with_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("x")
    with pytest.raises(UsageError, match="holds other files"), Ledger(tmp_path).opened():
        pass
    assert [item.name for item in tmp_path.iterdir()] == ["thesis.tex"]


def test_rows_come_back_as_they_were_written(tmp_path: Path) -> None:
    ledger = Ledger(tmp_path)
    entries = (Entry("ana", late=True), Entry("b\n🤖", sha256="0" * 64, same_as="ana"))
    ledger.write(entries, "timed_publisher", "1" * 64)
    assert ledger.read() == BatchRows("timed_publisher", None, entries, sha256="1" * 64)


@pytest.mark.parametrize("content", ["", "[]", '{"rows": [{"nobody": 1}]}'])
def test_a_damaged_ledger_is_named(tmp_path: Path, content: str) -> None:
    (tmp_path / BATCH_FILE).write_text(content)
    with pytest.raises(UsageError, match=r"batch\.json: is damaged"):
        Ledger(tmp_path).read()
