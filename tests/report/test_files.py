"""A file is written whole or not at all."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from grader.errors import GraderFault, UsageError
from grader.report.files import check_folder, refuse_inputs, write_whole


def test_the_users_umask_decides_who_may_read_it(tmp_path):
    file = tmp_path / "result.json"
    before = os.umask(0o027)
    try:
        write_whole(file, "")
    finally:
        os.umask(before)
    assert file.stat().st_mode & 0o777 == 0o640


def test_the_old_file_stays_when_the_new_one_cannot_be_written(tmp_path):
    file = tmp_path / "result.json"
    file.write_text("old")
    with pytest.raises(UnicodeEncodeError):
        write_whole(file, "new \ud800")
    assert file.read_text() == "old"
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("inside", [".", "a", "a/b"])
def test_a_file_where_a_folder_is_needed_is_named(tmp_path, inside):
    (tmp_path / "report").write_text("a file")
    with pytest.raises(UsageError, match="is not a folder; use another place"):
        check_folder(tmp_path / "report" / inside)
    (tmp_path / "gone").symlink_to("nowhere")
    with pytest.raises(UsageError, match="gone: is not a folder"):
        check_folder(tmp_path / "gone")
    for folder in (tmp_path, tmp_path / "new" / "one", Path("rosgrade-report")):
        check_folder(folder)


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ("report", r"report cannot be written: it is a folder"),
        ("file/result.json", r"result\.json cannot be written: .*/file is not a folder"),
    ],
)
def test_a_place_that_cannot_be_written_is_named_and_no_draft_is_left(tmp_path, place, said):
    (tmp_path / "report").mkdir()
    (tmp_path / "file").touch()
    with pytest.raises(UsageError, match=said):
        write_whole(tmp_path / place, "text")
    assert len(list(tmp_path.iterdir())) == 2


def test_a_full_disk_is_no_wrong_use(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(GraderFault, match=r"the disk is full \(.*result\.json.*\)"):
        write_whole(tmp_path / "result.json", "text")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("how", ["itself", "symbolic link", "hard link", "other path", "in it"])
def test_an_output_never_takes_the_place_of_an_input(tmp_path, how):
    read = tmp_path / "work" / "canvas.csv"
    read.parent.mkdir()
    read.write_text("Student,ID,Section\n")
    others = {"symbolic link": tmp_path / "link.csv", "hard link": tmp_path / "link.csv"}
    output = others.get(how, tmp_path / "work/../work/canvas.csv" if "path" in how else read)
    if how == "symbolic link":
        output.symlink_to(read)
    if how == "hard link":
        os.link(read, output)
    with pytest.raises(UsageError, match="this command reads"):
        refuse_inputs([None, output], [None, read.parent if how == "in it" else read])


@pytest.mark.parametrize("name", ["out.json", "junit.xml", "feedback.md", "points.txt"])
def test_an_output_of_an_earlier_run_is_replaced_also_within_a_submission(tmp_path, name):
    output = tmp_path / name
    refuse_inputs([output], [tmp_path])
    output.write_text("of an earlier run")
    refuse_inputs([output], [tmp_path])
    page = tmp_path / "rosgrade-report" / "report.html"
    write_whole(page, "handed in, and replaced all the same")
    refuse_inputs([page.parent, page], [tmp_path])
    with pytest.raises(UsageError, match="is given for two outputs"):
        refuse_inputs([tmp_path / "a", tmp_path / "b" / ".." / "a"], [])


def test_a_device_stays_a_device(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_whole(pipe, "result")
    assert os.read(reader, 10) == b"result"
    os.close(reader)
    assert pipe.is_fifo()


def test_a_limit_of_the_shell_is_no_wrong_use(tmp_path: Path) -> None:
    program = (
        "import pathlib, resource; from grader.report.files import write_whole; "
        "resource.setrlimit(resource.RLIMIT_FSIZE, (10, 10)); "
        f"write_whole(pathlib.Path({str(tmp_path / 'result.json')!r}), 'x' * 100)"
    )
    ended = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert "GraderFault: this machine: no file may be so large" in ended.stderr
    assert "raise `ulimit -f`" in ended.stderr
