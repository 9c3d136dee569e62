from __future__ import annotations

import contextlib
import errno
import os
import tarfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grader.errors import GraderFault, SubmissionError, UsageError
from grader.submission.intake.locate import opened, submission_id
from tests.submission.samples import PACKAGE, Tree, tar_bytes, tar_member, zip_bytes


def sha256(path: Path) -> str:
    with opened(path) as located:
        return located.sha256


def as_zip(prefix: str = "") -> bytes:
    return zip_bytes(*((f"{prefix}{name}", text.encode()) for name, text in PACKAGE.items()))


@pytest.mark.parametrize(
    ("folder", "found"),
    [
        (".", "."),
        ("bot_publisher", "bot_publisher"),
        ("src/bot_publisher", "src/bot_publisher"),
        ("alice-main/ws/src/bot_publisher", "src/bot_publisher"),
        ("alice-main/bot_publisher", "bot_publisher"),
    ],
)
def test_a_package_is_found_under_any_number_of_folders(
    tree: Tree, folder: str, found: str
) -> None:
    with opened(tree.package(folder=folder)) as located:
        assert located.packages == (found,)
        assert (located.root / found / "setup.py").read_text() == PACKAGE["setup.py"]
        assert located.id == "alice"


def test_the_name_of_a_folder_around_everything_is_not_part_of_the_submission(
    tree: Tree, tmp_path: Path
) -> None:
    tree.package(folder="ana_hw1/bot_publisher")
    with opened(tree.write({"ana_hw1/README": "x", "ana_hw1/build/.built_by": "colcon"})) as ana:
        files = [file.path for file in ana.files]
    assert "README" in files
    (tmp_path / "ben.zip").write_bytes(
        zip_bytes(
            *((f"b/bot_publisher/{path}", text.encode()) for path, text in PACKAGE.items()),
            ("b/README", b"x"),
        )
    )
    assert sha256(tmp_path / "ben.zip") == ana.sha256


@pytest.mark.parametrize("name", ["bob.ZIP", "bob.tar.gz"])
def test_an_archive_is_opened_and_named_without_its_suffix(tmp_path: Path, name: str) -> None:
    members = (tar_member(f"ws/{path}", text.encode()) for path, text in PACKAGE.items())
    content = as_zip("ws/") if name.lower().endswith("zip") else tar_bytes(*members)
    (tmp_path / name).write_bytes(content)
    with opened(tmp_path / name) as located:
        assert located.id == "bob"
        assert located.packages == ("ws",)
        assert (located.root / "ws/setup.py").read_text() == PACKAGE["setup.py"]


def test_a_folder_and_an_archive_of_it_have_the_same_hash(tree: Tree, tmp_path: Path) -> None:
    (tmp_path / "bob.zip").write_bytes(as_zip())
    assert sha256(tree.package(folder=".")) == sha256(tmp_path / "bob.zip")


def link(path: str, target: str) -> tuple[tarfile.TarInfo, bytes]:
    return tar_member(path, type=tarfile.SYMTYPE, linkname=target)


@pytest.mark.parametrize("target", ["/etc/passwd", "/nowhere", "..", "../x", "b/../../x"])
def test_an_archive_with_a_link_out_is_refused(tmp_path: Path, target: str) -> None:
    content = tar_bytes(tar_member("b/c.py"), link("a", target))
    linked = zip_bytes(("a", target.encode()), mode=0o120777)
    for name, data in (("eve.tar.gz", content), ("eve.zip", linked)):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(SubmissionError, match=r"^a: the link to .* leads out"):
            sha256(tmp_path / name)


@pytest.mark.parametrize(
    "path",
    [
        "ws/build/bot/package.xml",
        "ws/install/bot/lib/bot",
        "ws/log/latest",
        "install/x",
        "ws/src/bot/log/x",
        "mine/bin/python",
    ],
)
def test_links_out_of_what_colcon_and_venv_left_behind_are_left_out(
    tmp_path: Path, path: str
) -> None:
    present = ("ws/src/bot/package.xml", "ws/src/bot/log/COLCON_IGNORE", "mine/pyvenv.cfg")
    out = link(path, "/home/student/ros2_ws/src/bot/package.xml")
    (tmp_path / "ada.tar.gz").write_bytes(tar_bytes(*map(tar_member, present), out))
    with opened(tmp_path / "ada.tar.gz") as located:
        assert not [file for file in located.files if file.link is not None]


def test_in_a_package_a_folder_called_log_is_not_colcon_s(tmp_path: Path) -> None:
    content = tar_bytes(tar_member("src/bot/package.xml"), link("src/bot/log/x", "/etc/passwd"))
    (tmp_path / "eve.tar").write_bytes(content)
    with pytest.raises(SubmissionError, match="leads out"):
        sha256(tmp_path / "eve.tar")


def test_a_link_to_something_inside_is_kept_and_one_to_nothing_is_not(tmp_path: Path) -> None:
    links = [
        link("d/good", "../x"),
        link("again", "d/good"),
        link("dangling", "y"),
        link("loop", "loop"),
        link("whole", "."),
    ]
    (tmp_path / "ada.tar").write_bytes(tar_bytes(*links, tar_member("x", b"text")))
    with opened(tmp_path / "ada.tar") as located:
        assert [file.path for file in located.files] == ["again", "d/good", "x"]
        assert (located.root / "again").read_text() == "text"


PARTS = st.sampled_from(["a", "b", "c", "..", ".", "/"])
LINKS = st.dictionaries(
    st.sampled_from(["a", "b", "d/a", "d/b", "d/e/a"]),
    st.lists(PARTS, min_size=1, max_size=4).map("/".join),
    max_size=5,
)


@settings(deadline=None)
@given(LINKS)
def test_whatever_its_links_are_the_copy_holds_only_links_to_what_is_in_it(
    tmp_path_factory: pytest.TempPathFactory, links: dict[str, str]
) -> None:
    folder = tmp_path_factory.mktemp("links")
    (folder / "d/e").mkdir(parents=True)
    (folder / "c").touch()
    for path, target in links.items():
        (folder / path).symlink_to(target)
    with contextlib.suppress(SubmissionError), opened(folder) as located:
        root = located.root.resolve()
        for path in root.rglob("*"):
            assert path.exists()
            assert path.resolve().is_relative_to(root)


def test_a_workspace_with_build_and_install_is_the_same_submission(tree: Tree) -> None:
    before = sha256(tree.package())
    tree.package(folder="build/bot_publisher")
    tree.package(folder="install/bot_publisher/share/bot_publisher")
    with opened(tree.write({"log/latest/events.log": "x"})) as located:
        assert located.packages == ("src/bot_publisher",)
        assert located.sha256 == before


def test_the_hash_depends_on_paths_contents_and_executable_bits(tree: Tree) -> None:
    hashes = {sha256(tree.write({"a.py": "1"}))}
    hashes.add(sha256(tree.write({"a.py": "2"})))
    (tree.root / "a.py").chmod(0o755)
    hashes.add(sha256(tree.root))
    (tree.root / "a.py").rename(tree.root / "b.py")
    hashes.add(sha256(tree.root))
    (tree.root / "c.py").symlink_to("b.py")
    hashes.add(sha256(tree.root))
    assert len(hashes) == 5


def test_the_copy_is_private(tree: Tree) -> None:
    with opened(tree.package()) as located:
        (located.root / "src/bot_publisher/setup.py").write_text("changed")
        tree.write({"src/bot_publisher/new.py": ""})
        assert not (located.root / "src/bot_publisher/new.py").exists()
    assert not located.root.exists()
    assert (tree.root / "src/bot_publisher/setup.py").read_text() == PACKAGE["setup.py"]


@pytest.mark.parametrize(
    ("number", "kind", "message"),
    [
        (errno.EACCES, SubmissionError, r"a\.py: cannot be read"),
        (errno.ENOSPC, GraderFault, "this machine: the disk is full"),
        (errno.ENOENT, GraderFault, r"a\.py: changed while the submission was read"),
    ],
)
def test_a_file_that_cannot_be_read_is_no_fault_of_the_student_where_the_machine_is_full(
    tree: Tree, monkeypatch: pytest.MonkeyPatch, number: int, kind: type[Exception], message: str
) -> None:
    # Tests may run as root, who may read everything.
    def fail(*_: object) -> bytes:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("grader.submission.intake.locate._copy_file", fail)
    with pytest.raises(kind, match=message):
        sha256(tree.write({"a.py": "x"}))


@pytest.mark.parametrize("saved", [None, "y = 1\n", ""])
def test_what_is_saved_while_it_is_read_is_read_again(
    tree: Tree, monkeypatch: pytest.MonkeyPatch, saved: str | None
) -> None:
    root = tree.write({"a.py": "x", "b.py": "x"})

    def save(*_: object, **__: object) -> object:
        monkeypatch.undo()
        (root / "a.py").unlink()
        if saved is not None:
            (root / "a.py").write_text(saved)
        return listing

    from grader.submission.intake import locate

    listing = locate.list_files(root)
    monkeypatch.setattr(locate, "list_files", save)
    with opened(root) as located:
        there = {path.name: path.read_text() for path in located.root.iterdir()}
    assert there == ({"b.py": "x"} if saved is None else {"a.py": saved, "b.py": "x"})


@pytest.mark.parametrize(
    "path",
    [
        "https://github.com/ada/bot.git",
        "git@github.com:ada/bot.git",
        Path("https://github.com/ada/bot"),
    ],
)
def test_a_url_is_not_taken_for_a_path(path: str | Path) -> None:
    with pytest.raises(UsageError, match=r"(://|@)[^/].*: is a URL; clone it"), opened(path):
        pass


def test_a_path_that_does_not_exist_is_a_wrong_use(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="nobody: does not exist"), opened(tmp_path / "nobody"):
        pass
    with pytest.raises(UsageError, match="neither a folder nor a file"), opened("/dev/null"):
        pass


def test_a_submission_is_named_after_its_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.b").mkdir()
    monkeypatch.chdir(tmp_path / "a.b")
    assert submission_id(Path()) == "a.b"
    assert submission_id(Path("..")) == tmp_path.name
    assert submission_id(Path("/")) == "submission"
