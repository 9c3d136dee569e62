"""Attacks are graded for real: built with colcon and run, in the sandbox."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from grader.machine import ros
from grader.assignment.load import load_assignment
from grader.grading.grading import Grading
from grader.run.runner import Runner
from grader.sandbox.sandbox import Sandbox
from grader.sandbox.trial import try_sandbox

LESSON = Path(__file__).with_name("lesson")
MARKER = f"rosgrade-attack-{os.getpid()}"


@pytest.fixture(scope="session")
def sandbox(cache: Path) -> Sandbox:
    """The sandbox; without one there is nothing to attack."""
    found = try_sandbox()
    if found.problem:
        pytest.skip(f"no sandbox on this machine: {found.problem}; {found.remedy}")
    return Sandbox(cache)


@pytest.fixture(scope="session")
def grading(sandbox: Sandbox, cache: Path) -> Iterator[Grading]:
    """Grades submissions of the lesson; the grader's environment holds a secret."""
    os.environ["ROSGRADE_ATTACK_SECRET"] = MARKER
    with Runner(ros.find(), sandbox=sandbox) as runner:
        yield Grading(load_assignment(LESSON), runner, cache)
    del os.environ["ROSGRADE_ATTACK_SECRET"]


class Targets:
    """What attacks are after: files and listeners on this machine that the test itself made."""

    def __init__(self, folder: Path, cache: Path) -> None:
        self.folder = folder
        self.reached: list[str] = []
        for name in ("hidden.yaml", "results/result.json", "home/.ssh/id_ed25519"):
            file = folder / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text("secret\n")
        self._sockets = [socket.create_server(("127.0.0.1", 0))]
        for address in (f"\0{MARKER}", str(folder / "socket")):
            listener = socket.socket(socket.AF_UNIX)
            listener.bind(address)
            listener.listen()
            self._sockets.append(listener)
        self._threads = [
            threading.Thread(target=self._answer, args=(listener,)) for listener in self._sockets
        ]
        for thread in self._threads:
            thread.start()
        # A process of the instructor's, with a secret in its environment.
        self._neighbour = subprocess.Popen(
            [sys.executable, "-c", "input()", MARKER],
            stdin=subprocess.PIPE,
            env={**os.environ, "SECRET": MARKER},
        )
        self.values: dict[str, Any] = {
            "hidden": str(folder / "hidden.yaml"),
            "result": str(folder / "results" / "result.json"),
            "home": str(folder / "home" / ".ssh" / "id_ed25519"),
            "cache": str(cache),
            "repository": str(Path(__file__).resolve().parents[2]),
            "prefix": sys.prefix,
            "marker": MARKER,
            "port": self._sockets[0].getsockname()[1],
            "socket": str(folder / "socket"),
        }

    def spy(self) -> str:
        """The spy's source, aimed at these targets."""
        source = Path(__file__).with_name("spy.py").read_text(encoding="utf-8")
        return source.replace("TARGETS = {}", f"TARGETS = {self.values!r}")

    def close(self) -> None:
        """Close all listeners."""
        for listener in self._sockets:
            # Wakes the thread that waits for a connection.
            listener.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join()
        for listener in self._sockets:
            listener.close()
        self._neighbour.communicate(b"\n")

    def _answer(self, listener: socket.socket) -> None:
        while True:
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            self.reached.append(str(listener.family))
            with connection:
                connection.sendall(b"secret")


@pytest.fixture
def targets(tmp_path: Path, cache: Path) -> Iterator[Targets]:
    """Fresh targets."""
    made = Targets(tmp_path / "targets", cache)
    yield made
    made.close()
