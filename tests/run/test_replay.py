"""A real node gets the very inputs of a recording again."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from grader.errors import UsageError
from grader.machine import ros
from grader.machine.scratch import PREFIX
from grader.recording.mcap_reader import read_inputs, read_recording
from grader.recording.model import NS
from grader.run.replay import replay_scenario
from grader.run.request import RunRequest
from grader.run.runner import Runner
from tests.recording.written import write_robot_run
from tests.run.conftest import SUBMISSION, assignment, install, running
from tests.run.nodes import HEADER

ROOT = Path(__file__).resolve().parents[2]
ECHO = (
    HEADER
    + """
from std_msgs.msg import String

rclpy.init()
node = Node("echo")
publisher = node.create_publisher(String, "/echo", 10)

def heard(message):
    print("heard", message.data, flush=True)
    publisher.publish(String(data=message.data.upper()))

node.create_subscription(String, "/chatter", heard, 10)
rclpy.spin(node)
"""
)
WORDS = ["a", "b", "c", "d"]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The recording of a node that was sent four words, and its install space."""
    folder = tmp_path_factory.mktemp("replay")
    course = assignment(
        record=[{"topic": "/echo", "type": "std_msgs/msg/String"}],
        stimuli=[
            {
                "publish": "/chatter",
                "type": "std_msgs/msg/String",
                "messages": [{"data": word} for word in WORDS],
                "every": "50 ms",
            }
        ],
        until={"messages": len(WORDS)},
        timeout="10 s",
    )
    runner = Runner(ros.find())
    file, place = folder / "run.mcap", install(folder, ECHO)
    try:
        runner.run(RunRequest(course, course.scenarios[0], SUBMISSION, place, 1), file)
    finally:
        runner.close()
    return file, place


def replay(file: Path, place: Path, temporary: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "tests.run.one_replay", str(file), str(place)],
        cwd=ROOT,
        env={**os.environ, "TMPDIR": str(temporary)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


@pytest.mark.ros
def test_a_node_hears_the_same_words_never_earlier_than_then(
    run: tuple[Path, Path], tmp_path: Path
) -> None:
    file, place = run
    recording = read_recording(file)
    given = read_inputs(file, recording)
    assert [message.cdr[8:9].decode() for message in given] == WORDS
    player = replay(file, place, tmp_path)
    told, _ = player.communicate(timeout=600)
    assert player.returncode == 0, told
    heard = re.findall(r"^ *([\d.]+) s  bot_pub  heard (\w)$", told, re.MULTILINE)
    assert [word for _, word in heard] == WORDS
    assert recording.matched_ns is not None
    for (time_s, _), message in zip(heard, given, strict=True):
        assert float(time_s) >= (message.stamp_ns - recording.matched_ns) / NS - 0.001
    # Four answers at once are shown one by one; of a stream only some are.
    assert re.findall(r"/echo  \{data: (\w)\}$", told, re.MULTILINE) == ["A", "B", "C", "D"]
    assert re.search(r"rosgrade  4 messages on /echo$", told, re.MULTILINE)


@pytest.mark.ros
def test_ctrl_c_ends_the_node_and_leaves_nothing(run: tuple[Path, Path], tmp_path: Path) -> None:
    file, place = run
    player = replay(file, place, tmp_path)
    assert player.stdout is not None
    for line in player.stdout:
        if "heard a" in line:
            break
    player.send_signal(signal.SIGINT)
    told, _ = player.communicate(timeout=600)
    assert player.returncode == 130, told
    assert "Traceback" not in re.sub(r"bot_pub  .*", "", told)
    assert not running(str(tmp_path)) and not running(str(place))
    assert not list(tmp_path.glob(f"{PREFIX}replay-*"))


@pytest.mark.ros
def test_a_node_that_never_listens_is_reported(run: tuple[Path, Path], tmp_path: Path) -> None:
    file, _ = run
    place = install(tmp_path, "import time\nprint('no robot today', flush=True)\n")
    player = replay(file, place, tmp_path)
    told, _ = player.communicate(timeout=600)
    assert player.returncode == 1
    assert "bot_pub  no robot today" in told
    assert "the node has ended by itself (exit code 0)" in told


def test_without_inputs_there_is_nothing_to_replay(tmp_path: Path) -> None:
    recording = write_robot_run(tmp_path / "run.mcap")
    with pytest.raises(UsageError, match=r"run\.mcap: nothing was published to the node"):
        replay_scenario(tmp_path / "run.mcap", recording, assignment())


def test_a_scenario_that_is_no_longer_there_is_named(tmp_path: Path) -> None:
    recording = write_robot_run(tmp_path / "run.mcap", scenario="walk")
    with pytest.raises(UsageError, match="the assignment 'test' has no scenario 'walk'"):
        replay_scenario(tmp_path / "run.mcap", recording, assignment())
