from __future__ import annotations

import subprocess
import sys

from grader.run.descendants import command_line


def test_of_a_very_long_command_line_the_beginning_is_told() -> None:
    command = [sys.executable, "-S", "-c", "input()", *["x" * 100_000] * 10]
    with subprocess.Popen(command, stdin=subprocess.PIPE) as process:
        told = command_line(process.pid)
        process.communicate(b"\n")
    assert told.startswith(f"{sys.executable} -S -c input() xxx")
    assert len(told) == 1000
