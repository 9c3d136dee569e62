"""`--open`: with a browser, with one that fails, and on a machine that has none."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.conftest import ROOT, Rosgrade
from tests.cli.test_check import REFERENCE

URL = "http://127.0.0.1:8123/"
OPEN = f"from grader.cli.screen.console import open_page; open_page({URL!r})"


def opened(folder: Path, browser: str | None) -> subprocess.CompletedProcess[str]:
    """Open a page in a process of its own, as the commands do it."""
    environ = {
        name: value
        for name, value in os.environ.items()
        if name not in ("BROWSER", "DISPLAY", "WAYLAND_DISPLAY")
    }
    if browser is not None:
        environ["BROWSER"] = browser
    return subprocess.run(
        [sys.executable, "-c", OPEN],
        cwd=folder,
        env={**environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )


def script(folder: Path, text: str) -> Path:
    """A browser of a few lines."""
    file = folder / "browser"
    file.write_text(f"#!/bin/sh\n{text}\n")
    file.chmod(0o755)
    return file


def test_the_browser_of_the_user_gets_the_address(tmp_path: Path) -> None:
    browser = script(tmp_path, f'echo "$1" > {tmp_path}/asked')
    ended = opened(tmp_path, f"{browser} %s")
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")
    assert (tmp_path / "asked").read_text() == f"{URL}\n"


@pytest.mark.parametrize("browser", ["exit 3", None])
def test_the_address_is_printed_where_no_browser_starts(
    tmp_path: Path, browser: str | None
) -> None:
    ended = opened(tmp_path, browser and f"{script(tmp_path, browser)} %s")
    assert ended.returncode == 0
    assert ended.stderr == (
        f"rosgrade: warning: --open: no browser could be started; the page is {URL}\n"
    )


def test_a_browser_that_stays_does_not_hold_up_the_command(tmp_path: Path) -> None:
    browser = script(tmp_path, f"echo $$ > {tmp_path}/pid; exec sleep 50 >/dev/null 2>&1")
    ended = opened(tmp_path, f"{browser} %s")
    try:
        assert (ended.returncode, ended.stderr) == (0, "")
    finally:
        os.kill(int((tmp_path / "pid").read_text()), 9)


@pytest.mark.ros
def test_check_opens_the_report(
    rosgrade: Rosgrade, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    browser = script(tmp_path, f'echo "$1" > {tmp_path}/asked')
    monkeypatch.setenv("BROWSER", f"{browser} %s")
    ended = rosgrade("check", "timed_publisher", REFERENCE, "--only", "package", "--open")
    assert ended.returncode == 0, ended.stderr
    report = tmp_path / "rosgrade-report" / "timed_publisher" / "report.html"
    assert (tmp_path / "asked").read_text() == f"{report.as_uri()}\n"
