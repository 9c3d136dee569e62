"""``rosgrade sim``: the command line, the view, and Ctrl-C."""

from __future__ import annotations

import os
import pty
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from grader.cli.app import app
from grader.errors import RosgradeError, UsageError
from grader.run.cell.domain import lock_domain
from sim.live import parse_pose
from sim.motion import Pose

pytestmark = [
    pytest.mark.ros,
    # lark, which rclpy's interfaces import, still uses it.
    pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning"),
]

WORLDS = Path(__file__).parent / "worlds"
ROOM = str(WORLDS / "room.yaml")
LIMIT_S = 30.0


@pytest.fixture
def domain(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with lock_domain() as lock:
        yield str(lock.domain_id)


def start(domain: str, *arguments: str, **pipes: int) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "grader", "sim", *arguments, "--domain-id", domain]
    return subprocess.Popen(command, cwd=Path(__file__).parents[2], **pipes)


def test_without_a_terminal_it_writes_a_line_in_a_second(
    domain: str, capsys: pytest.CaptureFixture[str]
) -> None:
    app(["sim", ROOM, "--domain-id", domain, "--duration", "2.0"], standalone_mode=False)
    lines = capsys.readouterr().out.splitlines()
    # A busy machine may let a step more pass before the line is written.
    assert [round(float(line.split()[0])) for line in lines] == [1, 2]
    assert "ahead 3.00 m" in lines[0]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_ends_it_cleanly(domain: str, number: signal.Signals) -> None:
    process = start(domain, ROOM, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None
    assert process.stdout.readline().startswith(b"    1.")
    process.send_signal(number)
    _, errors = process.communicate(timeout=LIMIT_S)
    assert (process.returncode, errors) == (0, b"")


def test_on_a_terminal_it_draws_the_world_and_leaves_the_terminal_as_it_was(domain: str) -> None:
    controller, terminal = pty.openpty()
    process = start(domain, ROOM, stdin=terminal, stdout=terminal, stderr=terminal)
    os.close(terminal)
    output, is_open, is_interrupted = b"", True, False
    end_s = time.monotonic() + LIMIT_S
    try:
        while is_open:
            assert time.monotonic() < end_s, f"not over within {LIMIT_S} s: {output!r}"
            if select.select([controller], [], [], 0.1)[0]:
                try:
                    output += os.read(controller, 65536)
                except OSError:  # how Linux says that the other side is closed
                    is_open = False
            if b"Ctrl-C ends" in output and not is_interrupted:
                process.send_signal(signal.SIGINT)
                is_interrupted = True
        process.wait(LIMIT_S)
    finally:
        process.kill()
        process.wait(LIMIT_S)
        os.close(controller)
    text = output.decode(errors="replace")
    assert process.returncode == 0
    assert "room.yaml, burger" in text
    assert "→" in text
    assert "Traceback" not in text
    # The alternate screen is left again, and the cursor is shown.
    assert text.rindex("\x1b[?1049l") > text.rindex("\x1b[?1049h")
    assert text.rindex("\x1b[?25h") > text.rindex("\x1b[?25l")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["none.yaml"], r"^none.yaml: No such file"),
        (
            [ROOM, "--robot", "bugrer"],
            r"^there is no robot 'bugrer'.* Did you mean 'burger'\?",
        ),
        (
            [ROOM, "--pose", "0, 1.2, 0"],
            r"^.*room.yaml:8: boxes\[0\]: a robot with radius 0.1",
        ),
        ([ROOM, "--pose", "0, 1"], r"^--pose: expected \[x, y, yaw\]: 3 entries, not 2"),
        (
            [ROOM, "--set", "wall=2"],
            r"^.* no value 'wall' in this world. Did you mean 'wall_x'",
        ),
        ([ROOM, "--set", "wall"], r"^--set wall: write NAME=VALUE"),
        ([ROOM, "--options", ROOM], r"^.*room.yaml:2: bounds: unknown key 'bounds'"),
    ],
)
def test_a_mistake_is_one_message(arguments: list[str], message: str) -> None:
    with pytest.raises(RosgradeError, match=message):
        app(["sim", *arguments], standalone_mode=False)


def test_a_pose_may_have_units() -> None:
    assert parse_pose("1, 20 cm, 0") == Pose(1.0, pytest.approx(0.2), 0.0)
    assert parse_pose("[0, 0, 1 rad]") == Pose(0.0, 0.0, 1.0)
    with pytest.raises(UsageError, match="--pose: yaw: '90' has no unit"):
        parse_pose("0, 0, 90")


@pytest.mark.compiles
def test_turtles_run_too(tmp_path: Path, domain: str, capsys: pytest.CaptureFixture[str]) -> None:
    world = tmp_path / "pond.yaml"
    world.write_text("turtles: [{name: bob, pose: [1, 2, 90 deg]}]\n", encoding="utf-8")
    arguments = ["sim", str(world), "--domain-id", domain, "--duration", "1.2"]
    app(arguments, standalone_mode=False)
    assert "bob x 1.00 m y 2.00 m theta +90 deg" in capsys.readouterr().out
