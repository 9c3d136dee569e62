"""Why a launch file starts nothing."""

from __future__ import annotations

from grader.recording.model import Ending
from tests.checks.builder import died, failing, output, package, recording, submission

NAME = "bot_publisher"


def test_launch_file_not_installed() -> None:
    name = f"{NAME}/bot.launch.py"
    said = (
        f"file 'bot.launch.py' was not found in the share directory of package '{NAME}' which is "
        "at '/ws/install/share/bot_publisher'"
    )
    for files, expected in (
        (("src/launch/bot.launch.py",), "which is handed in as `src/launch/bot.launch.py`"),
        ((), "it installed `launch/robot.launch.py`"),
    ):
        shared = (("launch/robot.launch.py", ""),)
        run = recording(
            processes=(died(1, name=name),),
            nodes=(),
            ending=Ending.EXITED,
            log=output(said, name=name),
            submission=submission(package(shared=shared), files=files),
        )
        assert expected in failing("node.exists", run, name="/bot")
