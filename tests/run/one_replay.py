"""One replay in a process of its own. Usage: one_replay.py RECORDING INSTALL SCRATCH"""

from __future__ import annotations

import signal
import sys
from pathlib import Path

from grader import ros
from grader.recording.mcap_reader import read_recording
from grader.run.replay import make_order, play
from tests.run.conftest import assignment


def main(file: Path, install: Path, scratch: Path) -> int:
    """Replay a recording of the scenario `run`."""
    scratch.mkdir()
    found = ros.find()
    order = make_order(file, read_recording(file), assignment(), found, install, scratch)
    return play(order, found)


if __name__ == "__main__":
    # A test in the background of a shell inherits that Ctrl-C is ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.exit(main(*map(Path, sys.argv[1:])))
