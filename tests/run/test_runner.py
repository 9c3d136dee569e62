"""What a runner does with the process that forks its cells: no ROS needed for that."""

from __future__ import annotations

from pathlib import Path

import pytest

from grader.machine import ros
from grader.run import runner as runner_module
from grader.run.runner import Runner


class FakeServer:
    """A prefork server whose cells run on."""

    def __init__(self, *_: object) -> None:
        self.is_usable = True
        self.is_closed = False

    def close(self) -> None:
        self.is_closed = True


def test_cells_that_run_keep_their_folders_where_a_prefork_server_is_replaced(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(runner_module, "PreforkServer", FakeServer)
    monkeypatch.setattr(
        runner_module, "CellProcess", lambda prefork_server, _imports: prefork_server
    )
    runner = Runner(ros.RosInstallation("wheels", Path("python"), ()))
    first = runner._new_cell(())
    assert isinstance(first, FakeServer)
    first.is_usable = False
    second = runner._new_cell(())
    assert isinstance(second, FakeServer)
    assert second is not first
    # Closing waits for its cells, with a lock held that an interruption needs.
    assert not first.is_closed
    runner.close()
    assert first.is_closed
    assert second.is_closed
