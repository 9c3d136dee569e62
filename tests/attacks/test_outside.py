"""A signal that comes from outside of a sandbox is the machine's, whatever it hits."""

from __future__ import annotations

import os
import signal
import threading
from pathlib import Path

import pytest

from grader.grading.grading import Grading
from grader.grading.spine import HandedIn, grade
from grader.run.process.descendants import descendants
from grader.run.process.process_sandbox import WORKSPACE
from tests.attacks.submissions import write_submission

pytestmark = [pytest.mark.ros, pytest.mark.slow]


@pytest.mark.parametrize(
    ("number", "hits_sandbox"), [(signal.SIGKILL, False), (signal.SIGSTOP, True)]
)
def test_a_signal_from_outside_costs_no_points(
    grading: Grading, tmp_path: Path, number: signal.Signals, hits_sandbox: bool
) -> None:
    over = threading.Event()

    def strike() -> None:
        # At this pace it is hit before it stands, too.
        while not over.wait(0.002):
            for pid, line in descendants(os.getpid()).items():
                # Where it is built, there is no such place.
                runs = f" {WORKSPACE}/" in line and line.endswith("/bot_pub")
                if runs and line.startswith("bwrap") is hits_sandbox:
                    os.kill(pid, number)

    thread = threading.Thread(target=strike)
    thread.start()
    try:
        graded = grade(HandedIn(write_submission(tmp_path / "ana"), tmp_path / "out"), grading)
    finally:
        over.set()
        thread.join()
    assert graded.recordings, graded.prepared.record.build
    assert not graded.grade.graded
    # What stood still may have missed something else, too.
    told = f"got {number.name} from outside its sandbox during the run"
    faults = graded.recordings["run"].faults
    assert any(fault.endswith(told) for fault in faults), faults
