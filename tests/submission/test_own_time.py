"""What the machine takes from a build is not the build's: pure, and with real processes."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from grader.submission.build import bounded
from grader.submission.build.bounded import Command, Outcome, Starved, run_bounded
from grader.submission.build.own_time import Look, OwnTime, stalled_s, taken_s, throttled_s

BEGIN = Look(0.0)


@pytest.mark.parametrize(
    ("name", "after", "taken"),
    [
        ("it computes on an idle machine", Look(10, used_s=10, idle_s=10, does="R"), 0),
        ("it sleeps on an idle machine", Look(10, idle_s=20, does="S"), 0),
        ("it sleeps on a busy machine", Look(10, does="S"), 0),
        ("it is stopped on a busy machine", Look(10, does="T"), 0),
        ("it gets a tenth of a core", Look(10, used_s=1, does="SR"), 9),
        ("its own children have both cores", Look(10, used_s=20, does="R"), 0),
        ("its children had them and ended unseen", Look(10, unseen=2, does="R"), 0),
        ("others have one core of two", Look(10, used_s=10, does="R"), 0),
        ("a container had its share", Look(10, used_s=4, idle_s=16, throttled_s=6, does="R"), 6),
        ("it waits for a busy disk", Look(10, used_s=1, idle_s=19, stalled_s=9, does="D"), 9),
        ("it holds still in vfork", Look(10, idle_s=10, does="D"), 0),
        ("all was stopped for a while", Look(10, used_s=1, idle_s=19, late_s=8, does="S"), 8),
    ],
)
def test_only_what_others_explain_is_taken(name: str, after: Look, taken: float) -> None:
    assert taken_s(BEGIN, after, cpus=2) == taken, name


@pytest.mark.parametrize(
    "text", ["throttled_usec 2500000", "nr_periods 3\nthrottled_time 2500000000"]
)
def test_both_kinds_of_cgroups_tell_when_a_container_is_throttled(
    tmp_path: Path, text: str
) -> None:
    assert throttled_s(tmp_path) == 0.0
    folder = tmp_path if "usec" in text else tmp_path / "cpu"
    folder.mkdir(exist_ok=True)
    (folder / "cpu.stat").write_text(f"{text}\n")
    assert throttled_s(tmp_path) == 2.5


def test_the_pressure_on_disks_is_read_where_the_kernel_tells(tmp_path: Path) -> None:
    file = tmp_path / "io"
    assert stalled_s(file) == 0.0
    file.write_text("some avg10=0.00 avg60=0.00 avg300=0.00 total=1500000\nfull total=7\n")
    assert stalled_s(file) == 1.5


@pytest.mark.parametrize(
    ("wall_s", "own_s"), [pytest.param(9, 0, id="waits"), pytest.param(21, 11, id="writes on")]
)
def test_a_program_that_keeps_the_disks_busy_itself_has_twice_its_time(
    monkeypatch: pytest.MonkeyPatch, wall_s: int, own_s: float
) -> None:
    looks = (Look(second, idle_s=second, stalled_s=second, does="D") for second in range(99))
    monkeypatch.setattr(OwnTime, "_look", lambda *_: next(looks))
    clock = OwnTime(disk_s=10)
    for _ in range(wall_s):
        clock.look((), 0.0)
    assert (clock.wall_s, clock.own_s) == (wall_s, own_s)


@pytest.fixture
def crowded() -> Iterator[int]:
    """A CPU that eight other processes want, too."""
    cpu = min(os.sched_getaffinity(0))
    burners = [_start(f"os.sched_setaffinity(0, [{cpu}])\nwhile True: pass") for _ in range(8)]
    yield cpu
    for burner in burners:
        burner.kill()
        burner.wait()


def _start(program: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, "-I", "-S", "-c", f"import os\n{program}"])


def run(program: str, folder: Path, wall_s: float) -> Outcome:
    command = [sys.executable, "-I", "-S", "-c", f"import os, time\n{program}"]
    environment = {"PATH": os.environ["PATH"]}
    return run_bounded(Command(command, folder, environment), wall_s=wall_s)


def test_a_program_that_shares_a_core_has_as_much_longer(
    tmp_path: Path, crowded: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bounded, "_LONGEST_STRETCH", 100.0)
    # It gets half of the core at most: its session counts as much as that of the others.
    works = f"os.sched_setaffinity(0, [{crowded}])\nwhile time.process_time() < 1.5: pass"
    outcome = run(works, tmp_path, wall_s=2.0)
    assert (outcome.ended_by_us, outcome.status) == (None, 0)
    assert outcome.duration_s > 2.0


@pytest.mark.parametrize(
    ("program", "waited"),
    [
        ("time.sleep(60)", True),
        ("os.read(os.pipe()[0], 1)", True),
        ("import fcntl\nfor _ in 'ab': fcntl.flock(os.open('lock', os.O_CREAT), 2)", True),
        ("while True: pass", False),
        ("for _ in range(3): os.fork()\nwhile True: pass", False),
    ],
)
def test_a_program_that_does_not_end_is_ended_and_told_apart(
    tmp_path: Path, program: str, waited: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Also where the tests themselves run on a machine without time.
    monkeypatch.setattr(bounded, "_LONGEST_STRETCH", 100.0)
    outcome = run(program, tmp_path, wall_s=1.0)
    assert (outcome.ended_by_us, outcome.waited) == ("time", waited)


def test_a_sleeper_gains_nothing_from_a_busy_machine(tmp_path: Path, crowded: int) -> None:
    program = f"os.sched_setaffinity(0, [{crowded}])\ntime.sleep(90)"
    outcome = run(program, tmp_path, wall_s=1.0)
    assert (outcome.ended_by_us, outcome.waited) == ("time", True)


def test_a_program_without_any_cpu_is_given_up_without_a_verdict(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Still(OwnTime):
        def look(self, *_: object) -> None:
            self.wall_s += 3.0

    monkeypatch.setattr(bounded, "OwnTime", Still)
    with pytest.raises(Starved, match="Grade again when less runs here"):
        run("time.sleep(60)", tmp_path, wall_s=1.0)
