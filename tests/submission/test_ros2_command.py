"""The command ``ros2`` beside rosgrade's Python."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from grader.machine.ros import RosInstallation
from grader.submission.underlay import ros2_command
from grader.submission.underlay.building import digest
from grader.submission.underlay.distribution import SNAPSHOT
from grader.submission.underlay.kept import Installed, Kept
from grader.submission.underlay.ros2_command import absence_note, find_command, write_command
from grader.submission.underlay.store import UnderlayStore


@pytest.fixture
def wheels(tmp_path: Path) -> RosInstallation:
    prefix = tmp_path / "venv"
    (prefix / "bin").mkdir(parents=True)
    python = prefix / "bin/python"
    python.write_text('#!/bin/sh\necho "$AMENT_PREFIX_PATH|$@"\n')
    python.chmod(0o755)
    return RosInstallation("wheels", python, (prefix,))


def kept(cache: Path, ros: RosInstallation, name: str, package: str) -> Path:
    """A package as the store keeps it; where it is installed."""
    kept = Kept(cache / "underlays", ros)
    install = kept.install(name)
    install.mkdir(parents=True)
    about = Installed(name, "", (package,), (name,), SNAPSHOT.version, installation=digest(ros))
    kept.note(name, about)
    return install


def test_it_runs_the_underlay_s_ros2_behind_what_is_sourced_and_goes_with_it(
    wheels: RosInstallation, tmp_path: Path
) -> None:
    install = kept(tmp_path, wheels, "ros2cli", "ros2cli")
    store = UnderlayStore(tmp_path, wheels)
    command = write_command(wheels, store)
    assert command == find_command(wheels) == wheels.python.parent / "ros2"
    assert write_command(wheels, store) is None
    below = f"{install}:{wheels.prefixes[0]}"
    for sourced, seen in (("", below), ("/ws/install", f"/ws/install:{below}")):
        done = subprocess.run(
            [str(command), "topic", "list"],
            env={"AMENT_PREFIX_PATH": sourced},
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stdout.strip() == f"{seen}|{install}/bin/ros2 topic list"
    store.kept.remove("ros2cli")
    write_command(wheels, store)
    assert not command.exists()


def test_the_command_of_an_earlier_rosgrade_stays_as_long_as_what_it_runs(
    wheels: RosInstallation, tmp_path: Path
) -> None:
    program = kept(tmp_path, wheels, "ros2cli", "ros2cli") / "bin/ros2"
    program.parent.mkdir()
    program.touch()
    command = write_command(wheels, UnderlayStore(tmp_path, wheels))
    assert command is not None
    (program.parents[2] / "underlay.json").unlink()
    write_command(wheels, UnderlayStore(tmp_path, wheels))
    assert command.is_file()
    program.unlink()
    write_command(wheels, UnderlayStore(tmp_path, wheels))
    assert not command.exists()


def test_a_command_that_rosgrade_did_not_write_is_left_alone(
    wheels: RosInstallation, tmp_path: Path
) -> None:
    kept(tmp_path, wheels, "ros2cli", "ros2cli")
    own = wheels.python.parent / "ros2"
    own.write_text("#!/bin/sh\n")
    assert write_command(wheels, UnderlayStore(tmp_path, wheels)) is None
    assert own.read_text() == "#!/bin/sh\n"


def test_a_text_that_names_it_where_there_is_none_says_how_to_get_it(
    wheels: RosInstallation, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(wheels.python.parent))
    monkeypatch.setattr(ros2_command, "find", lambda: wheels)
    assert absence_note("a ROS 2 package") == ""
    assert "`rosgrade underlay add ros2cli`" in absence_note("`ros2 topic list` shows all")
    (wheels.python.parent / "ros2").touch(mode=0o755)
    assert absence_note("`ros2 topic list` shows all") == ""
