from __future__ import annotations

import subprocess

from grader.run.process.descendants import command_line


def test_of_a_very_long_command_line_the_beginning_is_told() -> None:
    command = ["sh", "-c", "echo; read line", *["x" * 100_000] * 10]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0
    ) as process:
        assert process.stdout is not None
        # Only now it has certainly been executed.
        process.stdout.read(1)
        told = command_line(process.pid)
        process.communicate(b"\n")
    assert told.startswith("sh -c echo; read line xxx")
    assert len(told) == 1000
