"""`rosgrade watch` as a student uses it: real files, real nodes, a real Ctrl-C."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import urllib.request
from collections.abc import Iterable
from pathlib import Path

import pytest

from grader.assignment.load import load_assignment
from tests.cli.conftest import ROOT, Rosgrade
from tests.cli.test_check import NODE, REFERENCE, _running

POINTS = {one.spec.id: one.spec.points for one in load_assignment("timed_publisher").checks}


def read_until(lines: Iterable[str], text: str) -> str:
    """All that was printed, up to the line with a text."""
    seen = []
    for line in lines:
        seen.append(line)
        if text in line:
            return "".join(seen)
    raise AssertionError(f"no {text!r} in:\n{''.join(seen)}")


@pytest.mark.ros
def test_a_save_is_graded_again_and_ctrl_c_leaves_nothing(tmp_path: Path) -> None:
    submission = tmp_path / "submission"
    shutil.copytree(REFERENCE, submission)
    node = submission / NODE
    watch = subprocess.Popen(
        [sys.executable, "-m", "grader", "watch", "timed_publisher", str(submission)],
        cwd=tmp_path,
        env={
            **os.environ,
            "PYTHONPATH": str(ROOT),
            "TMPDIR": str(tmp_path),
            "COLUMNS": "80",
            "PYTHONUNBUFFERED": "1",
        },
        stderr=subprocess.STDOUT,
        stdout=subprocess.PIPE,
        text=True,
        # Tests in the background of a shell inherit that Ctrl-C is ignored.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509
    )
    assert watch.stdout is not None
    try:
        url = read_until(watch.stdout, "Report page: ").split()[-1]
        assert "Score: 10 of 10 points" in read_until(watch.stdout, "Ctrl-C ends")

        node.write_text(node.read_text().replace("PERIOD_S = 0.3", "PERIOD_S = 2.5"))
        read_until(watch.stdout, "run: starting bot_publisher/bot_pub")
        node.write_text(node.read_text().replace("PERIOD_S = 2.5", "PERIOD_S = 0.4"))
        told = read_until(watch.stdout, "Ctrl-C ends")
        assert "saved again: starting over" in told
        lost = POINTS["period"]
        assert f"Score: {10 - lost:g} of 10 points, before 10" in told
        assert (
            f"Since your last save: “A message comes every 300 ms”: passed → failed, −{lost:g}   █"
            in told
        )
        browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
        browser.open(url).close()
        with browser.open(f"{url.partition('?')[0]}report.html") as served:
            assert (
                served.read()
                == (tmp_path / "rosgrade-report" / "timed_publisher" / "report.html").read_bytes()
            )

        right = node.read_text()
        line = right[: right.index("PERIOD_S = 0.4")].count("\n") + 1
        node.write_text(right.replace("PERIOD_S = 0.4", "PERIOD_S = = 0.4"))
        told = read_until(watch.stdout, "Ctrl-C ends")
        # Before colcon is asked.
        error = f"bot_publisher.py:{line}: SyntaxError: invalid syntax: PERIOD_S = = 0.4\n"
        assert told.index(error) < told.index("looking for an earlier build")

        node.write_text(right.replace("PERIOD_S = 0.4", "PERIOD_S = 2.5"))
        # What failed last is told as soon as it is known.
        read_until(watch.stdout, "passes now")
        read_until(watch.stdout, "run: recording")
        watch.send_signal(signal.SIGINT)
        told, _ = watch.communicate(timeout=600)
    finally:
        watch.kill()
        watch.wait()
        watch.stdout.close()
    assert watch.returncode == 0, told
    assert told.endswith("No longer watching.\n")
    assert "Traceback" not in told
    assert not _running(str(tmp_path))
    assert not list(tmp_path.glob("rosgrade-scratch-*"))


@pytest.mark.ros
def test_the_author_s_own_yaml_is_read_again_and_a_mistake_in_it_ends_nothing(
    tmp_path: Path,
) -> None:
    assignment = tmp_path / "timed_publisher"
    shutil.copytree(ROOT / "assignments" / "timed_publisher", assignment)
    yaml = assignment / "assignment.yaml"
    right = yaml.read_text(encoding="utf-8")
    title, points = "The package bot_publisher is there", "{package: 0.1"
    # The report lies in the assignment's own folder, as it does for an author who works there.
    watch = subprocess.Popen(
        [sys.executable, "-m", "grader", "watch", ".", str(REFERENCE), "--only", "package"],
        cwd=assignment,
        env={**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "80", "PYTHONUNBUFFERED": "1"},
        stderr=subprocess.STDOUT,
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509
    )
    assert watch.stdout is not None
    try:
        assert title in read_until(watch.stdout, "Ctrl-C ends")
        yaml.write_text(right.replace(points, "{pakage: 0.1"))
        told = read_until(watch.stdout, "Ctrl-C ends")
        line = right[: right.index(points)].count("\n") + 1
        assert f"assignment.yaml:{line}: " in told and "Did you mean 'package'?" in told
        assert "Score" not in told
        other = "  checks:\n    package: {title: Somebody handed in a package}\n"
        yaml.write_text(right.replace("  checks:\n", other))
        told = read_until(watch.stdout, "Ctrl-C ends")
        package = f"{POINTS['package']:g}"
        assert f"Score: {package} of {package} points" in told
        report = assignment / "rosgrade-report" / assignment.name / "report.html"
        assert "Somebody handed in a package" in report.read_text(encoding="utf-8")
        watch.send_signal(signal.SIGINT)
        told, _ = watch.communicate(timeout=600)
    finally:
        watch.kill()
        watch.wait()
        watch.stdout.close()
    assert told.endswith("No longer watching.\n")
    assert "Traceback" not in told


def test_a_port_that_is_taken_is_named(rosgrade: Rosgrade) -> None:
    import socket

    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        ended = rosgrade("watch", "timed_publisher", REFERENCE, "--port", port, "--sandbox", "none")
    assert ended.returncode == 2
    assert f"--port {port}: " in ended.stderr
    assert "Traceback" not in ended.stderr
