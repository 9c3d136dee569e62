"""`rosgrade review` as an instructor starts and ends it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

from tests.cli.conftest import ROOT, Rosgrade
from tests.server.make_class import make_class


def test_the_printed_address_opens_the_class_and_ctrl_c_ends_it(tmp_path: Path) -> None:
    out = make_class(tmp_path)
    browser_script = tmp_path / "browser"
    browser_script.write_text('#!/bin/sh\necho "$1" > asked\n')
    browser_script.chmod(0o755)
    environ = {"PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1", "BROWSER": f"{browser_script} %s"}
    review = subprocess.Popen(
        [sys.executable, "-m", "grader", "review", str(out), "--by", "AK", "--open"],
        cwd=tmp_path,
        env={**os.environ, **environ},
        stderr=subprocess.STDOUT,
        stdout=subprocess.PIPE,
        text=True,
        # Tests in the background of a shell inherit that Ctrl-C is ignored.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509
    )
    assert review.stdout is not None
    try:
        first = review.stdout.readline()
        assert "by AK: http://127.0.0.1:" in first
        browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
        with browser.open(first.split()[-1], timeout=600) as page:
            assert "Class overview" in page.read().decode()
        review.send_signal(signal.SIGINT)
        told, _ = review.communicate(timeout=600)
    finally:
        review.kill()
        review.wait()
        review.stdout.close()
    # The command line of a browser can be read by every user of the machine.
    assert (tmp_path / "asked").read_text() == f"{(out / 'open.html').as_uri()}\n"
    assert not (out / "open.html").exists()
    assert told.endswith("No longer serving.\n") and "Traceback" not in told
    assert review.returncode == 0


def test_a_folder_without_a_class_is_named(rosgrade: Rosgrade, tmp_path: Path) -> None:
    ended = rosgrade("review", tmp_path)
    assert ended.returncode == 2
    assert f"{tmp_path}: is not the folder of a batch" in " ".join(ended.stderr.split())


def test_a_port_that_is_taken_is_named(rosgrade: Rosgrade, tmp_path: Path) -> None:
    import socket

    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        ended = rosgrade("review", make_class(tmp_path), "--port", port)
    assert ended.returncode == 2
    assert f"--port {port}: " in ended.stderr
