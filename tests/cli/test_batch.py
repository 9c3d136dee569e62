"""`rosgrade batch` as an instructor uses it: a class, a roster, a kill -9 in the middle."""

from __future__ import annotations

import csv
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.cli.conftest import ROOT, Rosgrade

pytestmark = [pytest.mark.ros, pytest.mark.slow]

REFERENCE = ROOT / "reference" / "timed_publisher"
NODE = "bot_publisher/bot_publisher/bot_publisher.py"


def handed_in(course: Path, name: str, old: str = "", new: str = "") -> Path:
    """A submission to timed_publisher, perhaps with a mistake."""
    folder = course / name
    shutil.copytree(REFERENCE / "bot_publisher", folder / "bot_publisher")
    node = folder / NODE
    assert old in node.read_text()
    node.write_text(node.read_text().replace(old, new))
    return folder


def grades(out: Path) -> dict[str, dict[str, str]]:
    """Rows of grades.csv by submission."""
    with (out / "grades.csv").open(encoding="utf-8", newline="") as file:
        return {row["submission"]: row for row in csv.DictReader(file)}


def results(out: Path) -> dict[str, tuple[int, bytes]]:
    """When each result was written, and what it says."""
    return {
        str(file.relative_to(out)): (file.stat().st_mtime_ns, file.read_bytes())
        for file in out.glob("submissions/*/result.json")
    }


@pytest.fixture
def course(tmp_path: Path) -> Path:
    made = tmp_path / "class"
    made.mkdir()
    return made


def test_a_class_is_graded_and_no_student_is_forgotten(
    rosgrade: Rosgrade, tmp_path: Path, course: Path
) -> None:
    handed_in(course, "ana")
    handed_in(course, "ben", "PERIOD_S = 0.3", "PERIOD_S = 3.0")
    handed_in(course, "cai")
    (course / "dee.zip").write_bytes(b"PK\x03\x04 not a zip")
    with zipfile.ZipFile(course / "eli\nüñ🤖.zip", "w") as file:
        file.writestr("readme.txt", "I did not manage")
    (tmp_path / "roster.csv").write_text(
        "login,name,email\nana,Ana,ana@example.org\nben,Ben,\ncai,=cmd(),\nfay,Fay,\n"
    )
    out = tmp_path / "out"
    ended = rosgrade(
        "batch", "timed_publisher", course, "--out", out, "--roster", tmp_path / "roster.csv",
        "--sandbox", "none",
    )  # fmt: skip
    # Two of them cannot be read.
    assert ended.returncode == 3, ended.stderr
    assert "rosgrade: sandbox: none\n" in ended.stderr
    written = json.loads((out / "batch.json").read_text())["rows"]
    (ana,) = (row for row in written if row["key"] == "ana")
    assert (ana["email"], ana["source"]) == ("ana@example.org", str(course / "ana"))
    rows = grades(out)
    assert rows["ana"]["score"] == "10"
    assert rows["ana"]["note"] == "the same submission as cai"
    assert 0 < float(rows["ben"]["score"]) < 10
    assert rows["cai"]["score"] == "10"
    assert rows["cai"]["note"] == "the same submission as ana"
    assert rows["cai"]["name"] == "'=cmd()"
    assert (rows["dee"]["status"], rows["dee"]["score"]) == ("unreadable", "")
    assert rows["dee"]["note"].startswith("not in the roster; dee.zip: is broken")
    assert rows["fay"]["score"] == "" and rows["fay"]["note"] == "handed in nothing"
    assert len(rows) == 6
    assert "3 of 6 graded" in ended.stdout
    assert "2 unreadable, without a score; 1 handed in nothing" in ended.stdout
    overview = (out / "index.html").read_text(encoding="utf-8")
    assert "submissions/ana/report.html" in overview
    twin = json.loads((out / "submissions" / "cai" / "result.json").read_text())
    assert twin["submission"]["id"] == "cai"

    before = results(out)
    again = rosgrade("batch", "timed_publisher", course, "--out", out, "--sandbox", "none")
    assert "(0 now" in again.stdout
    assert results(out) == before

    regraded = rosgrade("regrade", out)
    assert "0 gain 0 points, 0 lose 0 points" in regraded.stdout
    assert results(out) == before

    retried = rosgrade(
        "batch", "timed_publisher", course, "--out", out, "--retry", "ben", "--sandbox", "none"
    )
    assert "(1 now" in retried.stdout
    changed = {name for name, state in results(out).items() if state != before[name]}
    assert changed == {"submissions/ben/result.json"}
    assert list(out.glob("submissions/ben/earlier/result-*.json"))


def class_command(course: Path, out: Path, count: int) -> list[str]:
    """Let so many hand in something of their own; how to grade them."""
    for number in range(count):
        handed_in(course, f"student{number}", "PERIOD_S = 0.3", f"PERIOD_S = 0.3  # {number}")
    return ["batch", "timed_publisher", str(course), "--out", str(out), "--sandbox", "none"]


def after_the_first(
    command: list[str], folder: Path, number: signal.Signals, *, again: bool = False
) -> tuple[int, str]:
    """Send a batch a signal when the first is graded; its exit status, and what it said then.

    Args:
        command: What to run.
        folder: Where.
        number: The signal.
        again: Whether it gets another one while it writes what came of it.
    """
    batch = subprocess.Popen(
        [sys.executable, "-m", "grader", *command, "--jobs", "1"],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    )
    assert batch.stderr is not None
    for line in batch.stderr:
        if " 1 of " in line:
            break
    batch.send_signal(number)
    if again:
        # At this line it begins to write what there is.
        said = next(line for line in batch.stderr if "interrupted; " in line)
        batch.send_signal(number)
    else:
        said = ""
    _, more = batch.communicate()
    return batch.returncode, said + more


def test_after_kill_9_the_same_command_goes_on(
    rosgrade: Rosgrade, tmp_path: Path, course: Path
) -> None:
    out = tmp_path / "out"
    command = class_command(course, out, 3)
    after_the_first(command, tmp_path, signal.SIGKILL)
    before = results(out)
    assert len(before) in (1, 2)
    ended = rosgrade(*command)
    assert ended.returncode == 0, ended.stderr
    after = results(out)
    assert len(after) == 3
    assert {name: after[name] for name in before} == before
    assert not (out / ".partial").exists()


@pytest.mark.parametrize("again", [False, True])
def test_after_ctrl_c_there_is_an_overview_of_what_is_graded(
    again: bool, tmp_path: Path, course: Path
) -> None:
    out = tmp_path / "out"
    command = class_command(course, out, 3)
    status, said = after_the_first(command, tmp_path, signal.SIGINT, again=again)
    assert status == 130
    assert "interrupted; " in said and "Traceback" not in said
    rows = grades(out)
    assert len(rows) == 3
    for name, row in rows.items():
        graded = (out / "submissions" / name / "result.json").is_file()
        assert row["score"] == ("10" if graded else "")
        assert row["note"] == ("" if graded else "not graded yet; run the batch again")
    overview = (out / "index.html").read_text(encoding="utf-8")
    assert "not graded yet; run the batch again" in overview


def test_a_class_goes_on_with_the_assignment_that_it_was_judged_with_last(
    rosgrade: Rosgrade, tmp_path: Path, course: Path
) -> None:
    """Nothing can be built here, so that only the way of the assignment is tried."""
    lesson, changed = (tmp_path / name / "timed_publisher" for name in ("lesson", "changed"))
    shutil.copytree(ROOT / "assignments" / "timed_publisher", lesson)
    shutil.copytree(lesson, changed)
    for folder, title in ((lesson, "As it was"), (changed, "As it is now")):
        yaml = folder / "assignment.yaml"
        text = yaml.read_text(encoding="utf-8")
        yaml.write_text(re.sub("(?m)^title: .*$", f"title: {title}", text), encoding="utf-8")
    for name in ("ana", "ben"):
        (course / name).mkdir()
        (course / name / "notes.txt").write_text(name)
    out, documented = tmp_path / "out", ("batch", lesson, course, "--out", tmp_path / "out")
    assert rosgrade(*documented, "--seed", "7", "--sandbox", "none").returncode == 3
    assert rosgrade("regrade", out, changed).returncode in (0, 3)
    (course / "ana" / "notes.txt").write_text("on Wednesday")
    again = rosgrade(*documented, "--sandbox", "none")
    assert again.returncode == 3 and f"graded with {changed}" in again.stderr, again.stderr
    shutil.rmtree(course / "ben")
    (course / "ana" / "notes.txt").write_text("on Thursday")
    alone = rosgrade("batch", out, "--sandbox", "none")
    assert alone.returncode == 3 and "(1 now" in alone.stdout, alone.stderr
    # Whose submission is not there any more stays as graded before.
    assert list(grades(out)) == ["ana", "ben"]
    written = json.loads((out / "batch.json").read_text())
    assert written["assignment"]["location"] == str(changed)
    assert written["taken_from"] == {"submissions": str(course), "roster": None, "seed": None}
    yaml = lesson / "assignment.yaml"
    yaml.write_text(yaml.read_text().replace("As it was", "As it will be"))
    refused = rosgrade(*documented, "--sandbox", "none")
    assert refused.returncode == 2 and f"`rosgrade regrade {out} {lesson}`" in refused.stderr
    assert f"`rosgrade batch {out}` goes on with theirs" in refused.stderr
