"""Why a launch file starts nothing."""

from __future__ import annotations

from grader.recording.model import Ending
from tests.checks.builder import died, failing, output, recording

NAME = "bot_publisher"


def test_launch_file_not_installed() -> None:
    name = f"{NAME}/bot.launch.py"
    said = (
        f"file 'bot.launch.py' was not found in the share directory of package '{NAME}' which is "
        "at '/ws/install/share/bot_publisher'"
    )
    run = recording(
        processes=(died(1, name=name),),
        nodes=(),
        ending=Ending.EXITED,
        log=output(said, name=name),
    )
    found = failing("node.exists", run, name="/bot")
    assert "installed no `bot.launch.py`" in found and "glob('launch/*')" in found
    assert "DESTINATION share/${PROJECT_NAME})" in found
