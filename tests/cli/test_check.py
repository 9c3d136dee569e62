"""`rosgrade check` on submissions of all kinds, with the real colcon and real nodes."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import pytest

from tests.cli.conftest import ROOT, Rosgrade

REFERENCE = ROOT / "reference" / "timed_publisher"
NODE = "bot_publisher/bot_publisher/bot_publisher.py"
REPORT = Path("rosgrade-report", "timed_publisher")

pytestmark = pytest.mark.ros


def copy(folder: Path, old: str = "", new: str = "", file: str = NODE) -> Path:
    """The reference with one text changed."""
    submission = folder / "submission"
    shutil.copytree(REFERENCE, submission)
    path = submission / file
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    return submission


def result(folder: Path) -> Any:
    """What was written into the default report folder."""
    return json.loads((folder / REPORT / "result.json").read_text(encoding="utf-8"))


def statuses(folder: Path) -> dict[str, str]:
    """Status of each check."""
    return {check["id"]: check["status"] for check in result(folder)["checks"]}


def test_the_reference_gets_full_points_and_a_report(rosgrade: Rosgrade, tmp_path: Path) -> None:
    ended = rosgrade("check", "timed_publisher", REFERENCE, "--json", "-")
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "Score: 10 of 10 points" in ended.stderr
    written = result(tmp_path)
    assert (written["score"], written["max_score"], written["graded"]) == (10, 10, True)
    assert json.loads(ended.stdout) == written
    assert "10" in (tmp_path / REPORT / "report.html").read_text(encoding="utf-8")

    again = rosgrade("regrade", tmp_path / REPORT)
    assert again.returncode == 0
    assert "no check changed" in again.stdout


def test_a_zip_of_a_workspace_is_graded_alike(rosgrade: Rosgrade, tmp_path: Path) -> None:
    archive = tmp_path / "ada.zip"
    with zipfile.ZipFile(archive, "w") as file:
        for path in REFERENCE.rglob("*"):
            if path.is_file() and "__pycache__" not in path.parts:
                file.write(path, f"ada/ros2_ws/src/{path.relative_to(REFERENCE)}")
    ended = rosgrade("check", "timed_publisher", archive, "--only", "package", "--quiet")
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert ended.stderr == ""


def test_only_one_check_and_what_it_requires_is_judged(rosgrade: Rosgrade, tmp_path: Path) -> None:
    rosgrade("check", "timed_publisher", REFERENCE, "--only", "dependencies")
    judged = statuses(tmp_path)
    assert {"package", "dependencies"} <= judged.keys()
    assert "period" not in judged
    assert not list((tmp_path / REPORT / "recordings").glob("*.mcap"))


@pytest.mark.parametrize(
    ("files", "said"),
    [
        ({}, "empty"),
        ({"notes.txt": "hello"}, "no package.xml"),
        ({"a/package.xml": "<package", "notes.txt": ""}, "a/package.xml"),
    ],
)
def test_a_submission_without_a_package_gets_no_points_and_a_reason(
    rosgrade: Rosgrade, tmp_path: Path, files: dict[str, str], said: str
) -> None:
    submission = tmp_path / "submission"
    submission.mkdir()
    for name, content in files.items():
        (submission / name).parent.mkdir(exist_ok=True)
        (submission / name).write_text(content, encoding="utf-8")
    ended = rosgrade("check", "timed_publisher", submission)
    assert ended.returncode == 1, ended.stderr
    assert said in ended.stdout
    assert "Traceback" not in ended.stdout + ended.stderr
    assert statuses(tmp_path)["package"] == "failed"
    assert result(tmp_path)["score"] == 0


def test_a_report_shows_the_attempts_before_it(rosgrade: Rosgrade, tmp_path: Path) -> None:
    notes = tmp_path / "submission" / "notes.txt"
    notes.parent.mkdir()
    for text in ("first", "second", "second"):
        notes.write_text(text)
        rosgrade("check", "timed_publisher", notes.parent)
    first, second = result(tmp_path)["attempts"]
    assert (first["counts"], second["counts"]) == (False, True)
    page = (tmp_path / REPORT / "report.html").read_text(encoding="utf-8")
    assert "the one before had 0 points" in page
    assert rosgrade("regrade", REPORT).returncode == 1
    assert [one["sha256"] for one in result(tmp_path)["attempts"]] == [
        first["sha256"],
        second["sha256"],
    ]


def test_a_crash_is_shown_with_the_student_s_file_and_line(
    rosgrade: Rosgrade, tmp_path: Path
) -> None:
    submission = copy(tmp_path, "super().__init__(", "print(undefined)\n        super().__init__(")
    ended = rosgrade("check", "timed_publisher", submission, columns=200)
    assert ended.returncode == 1
    assert statuses(tmp_path)["starts"] == "failed"
    assert "NameError" in ended.stdout
    line = (submission / NODE).read_text().splitlines().index("        print(undefined)") + 1
    assert f"{NODE}:{line}" in ended.stdout
    assert f"❱ {line}     print(undefined)" in ended.stdout
    report = tmp_path / REPORT
    address = f'href="vscode://file{submission.resolve()}/{NODE}:{line}"'
    assert address in (report / "report.html").read_text(encoding="utf-8")
    # As it was graded, also when it is rendered for others.
    assert (report / "source" / NODE).read_text() == (submission / NODE).read_text()
    rosgrade("report", REPORT)
    again = (report / "report.html").read_text(encoding="utf-8")
    assert "vscode://" not in again and 'class="is-meant"' in again


def test_a_finding_shows_where_the_program_creates_what_it_is_about(
    rosgrade: Rosgrade, tmp_path: Path
) -> None:
    submission = copy(tmp_path, "PERIOD_S = 0.3", "PERIOD_S = 0.4")
    rosgrade("check", "timed_publisher", submission, "--only", "period")
    (found,) = [one for one in result(tmp_path)["checks"] if one["id"] == "period"]
    lines = (submission / NODE).read_text().splitlines()
    origins = [(one["file"], lines[one["line"] - 1]) for one in found["evidence"]["origins"]]
    assert [file for file, _ in origins] == [NODE, NODE]
    assert [words.split("(")[0].strip() for _, words in origins] == [
        "self.timer = self.create_timer",
        "self.publisher = self.create_publisher",
    ]


def test_a_report_never_replaces_a_folder_of_sources_that_is_not_its_own(
    rosgrade: Rosgrade, tmp_path: Path
) -> None:
    own = tmp_path / "thesis" / "source" / "chapter.tex"
    own.parent.mkdir(parents=True)
    own.write_text("mine")
    ended = rosgrade("check", "timed_publisher", REFERENCE, "--report", "thesis")
    assert ended.returncode == 2 and "does not belong to a report" in ended.stderr
    assert own.read_text() == "mine"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_an_interrupted_check_leaves_nothing_behind_that_stops_the_next(
    number: signal.Signals, rosgrade: Rosgrade, tmp_path: Path
) -> None:
    submission = copy(tmp_path, "PERIOD_S = 0.3", "PERIOD_S = 2.5")
    check = subprocess.Popen(
        [sys.executable, "-m", "grader", "check", "timed_publisher", str(submission)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(tmp_path)},
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        # Tests in the background of a shell inherit that Ctrl-C is ignored, below nohup SIGHUP.
        preexec_fn=lambda: signal.signal(number, signal.SIG_DFL),  # noqa: PLW1509
    )
    assert check.stderr is not None
    for line in check.stderr:
        if "run: recording" in line:
            break
    check.send_signal(number)
    _, told = check.communicate(timeout=600)
    assert check.returncode == 130, told
    assert "rosgrade: interrupted: ending what still runs" in told
    assert "Traceback" not in told
    assert not (tmp_path / REPORT / "result.json").exists()
    assert not list(tmp_path.glob("rosgrade-scratch-*"))
    assert not _running(str(tmp_path))
    again = rosgrade("check", "timed_publisher", submission, "--only", "package")
    assert again.returncode == 0, again.stderr


def _running(fragment: str) -> list[bytes]:
    """Command lines with a text in them, our own left aside."""
    found = []
    for file in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            line = file.read_bytes()
        except OSError:
            continue
        if fragment.encode() in line and int(file.parent.name) != os.getpid():
            found.append(line)
    return found
