"""What a watchdog ends processes for, beside what the attacks show in a real sandbox."""

from __future__ import annotations

from pathlib import Path

import pytest

from grader.run.host import watchdog
from grader.run.host.watchdog import Watchdog
from grader.sandbox.limits import SandboxLimits


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Stands for what students can write to."""
    for name in ("disk", "shared"):
        (tmp_path / name).mkdir()
    monkeypatch.setattr(watchdog, "STUDENT", tmp_path)
    return tmp_path


def watched(limits: SandboxLimits) -> list[str]:
    dog = Watchdog(limits, inits=lambda: (), output_bytes=lambda: 0)
    dog.start()
    return [breach.taken for breach in dog.stop() if breach.what == "memory"]


def test_messages_that_fill_the_cell_are_the_submission_s(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert watched(SandboxLimits()) == []
    monkeypatch.setattr(watchdog, "_OWN_BYTES", 2**20)
    (taken,) = watched(SandboxLimits())
    assert taken.endswith("of memory where messages wait")
