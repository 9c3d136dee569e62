"""One run in a process of its own: prints the distinct values that it heard.

Usage: one_run.py FOLDER VALUE [forever]
"""

from __future__ import annotations

import sys
from pathlib import Path

from grader.machine import ros
from grader.recording.mcap_reader import read_recording
from grader.run.request import RunRequest
from grader.run.runner import Runner
from tests.run import nodes
from tests.run.conftest import SUBMISSION, assignment, install


def main(folder: Path, value: str, forever: bool) -> None:
    """Run a node that publishes a value."""
    until = {"elapsed": "600 s"} if forever else {"messages": 10}
    course = assignment(until=until, timeout="600 s" if forever else "10 s")

    def progress(_scenario: str, event: object) -> None:
        if forever and isinstance(event, dict) and event["event"] == "recording":
            print("recording", flush=True)

    runner = Runner(ros.find(), progress=progress)
    source = nodes.timed(value=float(value))
    file = folder / "run.mcap"
    with runner:
        place = install(folder, source)
        runner.run(RunRequest(course, course.scenarios[0], SUBMISSION, place, 1), file)
    recording = read_recording(file)
    print(*sorted({str(m.value["linear"]["x"]) for m in recording.on("/cmd_vel")}))


main(Path(sys.argv[1]), sys.argv[2], len(sys.argv) > 3)
