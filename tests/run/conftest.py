"""Real nodes in real cells, without a build: the executable is written by the test."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from grader.assignment.model import Assignment
from grader.machine import ros
from grader.recording.mcap_reader import read_recording
from grader.recording.model import Recording
from grader.recording.submission import SubmissionRecord
from grader.run.imposing.mistake import Mistake
from grader.run.process.descendants import command_line
from grader.run.request import RunRequest
from grader.run.runner import Runner
from grader.spec.names import NO_NAMES, Names

PACKAGE, EXECUTABLE = "bot_publisher", "bot_pub"
SUBMISSION = SubmissionRecord(id="test", sha256="0" * 64)

RunNode = Callable[..., Recording]


def assignment(**scenario: Any) -> Assignment:
    """An assignment with one scenario that launches the executable under test."""
    return Assignment.model_validate(
        {
            "rosgrade": 1,
            "id": "test",
            "title": "Test",
            "packages": [{"name": PACKAGE, "executables": [EXECUTABLE]}],
            "scenarios": [
                {
                    "id": "run",
                    "launch": [{"executable": EXECUTABLE}],
                    "record": [{"topic": "/cmd_vel", "type": "geometry_msgs/msg/Twist"}],
                    "until": {"messages": 3},
                    "timeout": "5 s",
                    **scenario,
                }
            ],
            "checks": [{"id": "any", "uses": "node.alive", "points": 1}],
        }
    )


def install(folder: Path, source: str, name: str = f"{PACKAGE}/{EXECUTABLE}") -> Path:
    """An install space (merged layout) with one executable."""
    file = folder / "install" / "lib" / name
    file.parent.mkdir(parents=True)
    file.write_text(f"#!{sys.executable}\n{source}", encoding="utf-8")
    file.chmod(0o755)
    return folder / "install"


def running(marker: str) -> list[int]:
    """Processes of this machine whose command line holds a text."""
    found = [int(path.name) for path in Path("/proc").glob("[0-9]*")]
    return [pid for pid in found if pid != os.getpid() and marker in command_line(pid)]


@pytest.fixture(scope="module")
def runner() -> Iterator[Runner]:
    """Runs nodes one after the other, as those of a class: what it prepares is made once."""
    with Runner(ros.find()) as made:
        yield made


@pytest.fixture
def run_node(runner: Runner, tmp_path: Path) -> RunNode:
    """Run a node's source in a cell and read what was recorded."""
    return runs_of(runner, tmp_path)


def runs_of(runner: Runner, tmp_path: Path) -> RunNode:
    """Run a node's source by this runner and read what was recorded."""
    numbers = iter(range(1000))

    def run(
        source: str,
        progress: Callable[[str, Mapping[str, Any]], None] | None = None,
        worlds: Path = Path(),
        pauses: bool = False,
        names: Names = NO_NAMES,
        mistakes: tuple[Mistake, ...] = (),
        underlays: tuple[Path, ...] = (),
        **scenario: Any,
    ) -> Recording:
        folder = tmp_path / str(next(numbers))
        course = assignment(**scenario)
        runner.progress = progress or (lambda _scenario, _event: None)
        file = folder / "run.mcap"
        request = RunRequest(
            course,
            course.scenarios[0],
            SUBMISSION,
            install(folder, source),
            seed=1,
            worlds=worlds,
            pauses=pauses,
            names=names,
            mistakes=mistakes,
            underlays=underlays,
        )
        runner.run(request, file)
        return read_recording(file)

    return run
