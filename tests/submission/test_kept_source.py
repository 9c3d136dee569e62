"""The source of a submission stays readable beside its result, whatever was handed in."""

from __future__ import annotations

from pathlib import Path

import pytest

from grader.submission import kept_source
from grader.submission.kept_source import KeptSource, keep_source, read_kept_source
from tests.submission.samples import Tree


def kept(root: Path, folder: Path) -> KeptSource:
    keep_source(root, folder)
    return read_kept_source(folder)


def test_text_is_kept_as_it_was_handed_in_and_all_else_is_named(tree: Tree, tmp_path: Path) -> None:
    root = tree.write(
        {
            "src/bot/package.xml": "<package/>",
            "src/bot/bot/node.py": "x = 1\r\n",
            "src/bot/msg/Status.msg": "bool ok\n",
            "build/bot/node.py": "made by colcon",
            "install/setup.sh": "",
            "log/build.log": "",
        }
    )
    (root / "src/bot/arrow.png").write_bytes(b"\x89PNG\0\0")
    (root / "src/bot/latin.txt").write_bytes(b"caf\xe9\n")
    (root / "src/bot/same.py").symlink_to("bot/node.py")
    source = kept(root, tmp_path / "source")
    assert source.files == {
        "src/bot/bot/node.py": "x = 1\n",
        "src/bot/latin.txt": "caf\ufffd\n",
        "src/bot/msg/Status.msg": "bool ok\n",
        "src/bot/package.xml": "<package/>",
    }
    assert source.left_out == ("src/bot/arrow.png", "src/bot/same.py")
    assert (tmp_path / "source/src/bot/bot/node.py").read_bytes() == b"x = 1\r\n"


def test_what_is_too_large_takes_no_place_of_the_programs(tree: Tree, tmp_path: Path) -> None:
    table = "1,2\n" * (kept_source.LARGEST_BYTES // 4)
    root = tree.write({f"a{number:02}.csv": table for number in range(40)})
    tree.write({"a.txt": table + "3", "z/node.py": "x = 1\n"})
    source = kept(root, tmp_path / "source")
    assert source.files["z/node.py"] == "x = 1\n"
    assert sum(map(len, source.files.values())) <= kept_source.MOST_BYTES
    assert {*source.files, *source.left_out} == {file.name for file in root.glob("a*")} | {
        "z/node.py"
    }
    assert "a.txt" in source.left_out


def test_of_very_many_files_some_are_kept_and_some_named(
    tree: Tree, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kept_source, "MOST_FILES", 5)
    root = tree.write({f"{number:03}.py": "x" * number for number in range(300)})
    source = kept(root, tmp_path / "source")
    assert list(source.files) == ["000.py", "001.py", "002.py", "003.py", "004.py"]
    assert source.left_out[0] == "005.py" and source.left_out[-1] == "… and 95 more"


def test_names_cannot_deceive_a_reader(tree: Tree, tmp_path: Path) -> None:
    root = tree.write({"\u202eyp.py": "", "\x1b[2J.py": ""})
    assert list(kept(root, tmp_path / "source").files) == ["\\x1b[2J.py", "\\u202eyp.py"]


def test_where_nothing_was_kept_nothing_is_read(tmp_path: Path) -> None:
    assert read_kept_source(tmp_path / "missing") == KeptSource()
