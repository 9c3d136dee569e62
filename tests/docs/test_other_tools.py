"""What docs/other-tools.md shows of other tools is run as it stands there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from grader.machine import resources
from tests.recording.written import write_robot_run

PAGE = resources.PACKAGE.parent / "docs" / "other-tools.md"
SHOWN = dict(
    re.findall(r'```python title="with (\w+)"\n(.*?)```', PAGE.read_text("utf-8"), re.DOTALL)
)


@pytest.mark.parametrize(
    ("tool", "printed"),
    [("rosbags", ["0.6 0.1", "0.9 0.1", "1.2 0.1"]), ("mcap", ["0.4 ready"])],
)
def test_the_page_shows_how_another_tool_reads_a_recording(
    tool: str,
    printed: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "recordings").mkdir()
    write_robot_run(tmp_path / "recordings" / "run.mcap")
    monkeypatch.chdir(tmp_path)
    exec(compile(SHOWN[tool], str(PAGE), "exec"), {})
    assert capsys.readouterr().out.splitlines() == printed
