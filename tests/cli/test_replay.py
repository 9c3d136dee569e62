"""`rosgrade replay`, used wrongly: one message, no traceback."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.conftest import ROOT, Rosgrade
from tests.recording.written import write_robot_run

REFERENCE = ROOT / "reference" / "timed_publisher"


@pytest.mark.parametrize(
    ("content", "said"),
    [(None, "run.mcap: No such file"), (b"no mcap", "run.mcap: damaged recording")],
)
def test_a_recording_that_cannot_be_read_is_named(
    rosgrade: Rosgrade, tmp_path: Path, content: bytes | None, said: str
) -> None:
    if content is not None:
        (tmp_path / "run.mcap").write_bytes(content)
    ended = rosgrade("replay", "run.mcap", REFERENCE)
    assert ended.returncode == 2
    assert said in ended.stderr
    assert "Traceback" not in ended.stderr


def test_a_recording_that_names_no_assignment_asks_for_it(
    rosgrade: Rosgrade, tmp_path: Path
) -> None:
    write_robot_run(tmp_path / "run.mcap")
    ended = rosgrade("replay", "run.mcap", REFERENCE)
    assert ended.returncode == 2
    assert "the assignment is not stored here; name it too" in ended.stderr


@pytest.mark.ros
def test_a_node_that_was_given_nothing_has_nothing_to_replay(
    rosgrade: Rosgrade, tmp_path: Path
) -> None:
    write_robot_run(tmp_path / "run.mcap")
    ended = rosgrade("replay", "run.mcap", REFERENCE, "timed_publisher", "--quiet")
    assert ended.returncode == 2
    assert "nothing was published to the node in this run" in ended.stderr
    assert ended.stdout == ""


@pytest.mark.ros
def test_a_submission_that_does_not_build_says_why(rosgrade: Rosgrade, tmp_path: Path) -> None:
    write_robot_run(tmp_path / "run.mcap")
    (tmp_path / "empty").mkdir()
    ended = rosgrade("replay", "run.mcap", "empty", "timed_publisher")
    assert ended.returncode == 2
    assert "rosgrade: error: empty: " in ended.stderr
    assert "Traceback" not in ended.stderr
