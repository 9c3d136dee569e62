"""The real command in a process of its own, as a user runs it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

Rosgrade = Callable[..., "subprocess.CompletedProcess[str]"]
ROOT = Path(__file__).resolve().parents[2]
# Imports take most of the time of a short command: they are made once, and each command is a fork.
_SERVER = """\
import json, os, pkgutil, sys, numpy
from grader import batch, checks, cli, diagnosis, grading, report
from grader.__main__ import main
for room in (batch, checks, cli, diagnosis, grading, report):
    for module in pkgutil.walk_packages(room.__path__, f"{room.__name__}."):
        __import__(module.name)
for line in sys.stdin:
    arguments, folder, environment, *files = json.loads(line)
    pid = os.fork()
    if pid == 0:
        os.chdir(folder)
        os.environ.clear()
        os.environ.update(environment)
        for number, file in enumerate(files):
            os.dup2(os.open(file, os.O_RDWR | os.O_CREAT | os.O_TRUNC), number)
        sys.argv = ["rosgrade", *arguments]
        sys.exit(main())
    print(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), flush=True)
"""


@pytest.fixture(scope="session")
def server() -> Iterator[subprocess.Popen[str]]:
    """Forks a process for each command."""
    command = [sys.executable, "-c", _SERVER]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, cwd=ROOT, **pipes) as started:
        yield started


@pytest.fixture
def rosgrade(
    server: subprocess.Popen[str], tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> Rosgrade:
    """Run ``rosgrade`` in an empty folder, with a cache that all tests share."""
    files = [tmp_path_factory.mktemp("streams") / name for name in ("out", "err")]

    def run(*arguments: object, columns: int = 100) -> subprocess.CompletedProcess[str]:
        assert server.stdin and server.stdout
        words = list(map(str, arguments))
        environment = {**os.environ, "COLUMNS": str(columns), "PYTHONPATH": str(ROOT)}
        streams = [os.devnull, *map(str, files)]
        print(
            json.dumps([words, str(tmp_path), environment, *streams]), file=server.stdin, flush=True
        )
        code = int(server.stdout.readline())
        return subprocess.CompletedProcess(words, code, *(file.read_text() for file in files))

    return run
