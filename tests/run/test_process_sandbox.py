"""A process of the student in a sandbox of its own."""

from __future__ import annotations

import os
import time
from pathlib import Path

from grader.run.process.process_sandbox import ProcessSandbox, SandboxedProcess
from grader.sandbox.limits import SandboxLimits
from grader.sandbox.seccomp import student_filter


class OfASlowMachine(SandboxLimits):
    """Limits that are in force only when a file is there."""

    gate: Path

    def prlimit(self, more_processes: int = 0) -> list[str]:
        wait = f'until [ -e {self.gate} ]; do sleep 0.02; done; exec "$@"'
        return ["sh", "-c", wait, "sh", *super().prlimit(more_processes)]


def test_a_program_has_not_begun_before_its_sandbox_stands(tmp_path: Path) -> None:
    OfASlowMachine.gate, rules = tmp_path / "gate", tmp_path / "filter"
    rules.write_bytes(student_filter())
    arguments = ("--ro-bind", "/", "/", "--proc", "/proc", "--unshare-pid", "--die-with-parent")
    names = dict.fromkeys(("filter", "unguarded", "guard"), str(rules))
    limits = OfASlowMachine()
    sandbox = ProcessSandbox(arguments, **names, calls={}, limits=limits, folders={})
    process = SandboxedProcess(sandbox, ("sleep", "60"), {"PATH": os.defpath}, ())
    try:
        assert not process.has_begun
        OfASlowMachine.gate.touch()
        while not process.has_begun:
            assert process.poll() is None
            time.sleep(0.01)
    finally:
        process.kill()
        process.communicate()
