"""One replay in a process of its own. Usage: one_replay.py RECORDING INSTALL"""

from __future__ import annotations

import signal
import sys
from pathlib import Path

from grader.machine import ros
from grader.recording.mcap_reader import read_recording
from grader.run.replay import replay, replay_scenario
from grader.run.request import RunRequest
from tests.run.conftest import SUBMISSION, assignment

if __name__ == "__main__":
    # A test in the background of a shell inherits that Ctrl-C is ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    file, install = map(Path, sys.argv[1:])
    recording = read_recording(file)
    course = assignment()
    scenario = replay_scenario(file, recording, course)
    request = RunRequest(course, scenario, SUBMISSION, install, recording.seed)
    sys.exit(replay(request, ros.find()))
