"""Runs a program of rosgrade's that parses what a student handed in, where it can do no harm.

What parses a student's bytes may be made to fail, or to do what they say. So it runs in a process
of its own, in the sandbox and the limits of a build, and only its output comes back.
"""

from __future__ import annotations

import os
import shutil
import stat
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from grader.machine.ros import RosInstallation
from grader.sandbox.limits import BUILD, size_words
from grader.sandbox.usage import Usage, folder_usage
from grader.submission.build.bounded import Command, Outcome, OutputLimits, run_bounded

if TYPE_CHECKING:
    from grader.sandbox.sandbox import Sandbox


@dataclass(frozen=True)
class Reader:
    """A program that reads files of a submission, and what it may take.

    Attributes:
        program: A file beside this one. It imports nothing of rosgrade's.
        libraries: What it imports besides Python's own.
    """

    program: str
    libraries: tuple[str, ...]
    wall_s: float
    output: OutputLimits

    def run(
        self,
        root: Path,
        arguments: Sequence[str],
        ros: RosInstallation,
        sandbox: Sandbox | None,
        given: str = "",
    ) -> tuple[Outcome, bytes]:
        """Run it, and read what it wrote into the file ``kept`` in its working directory.

        Args:
            root: The submission's private copy; what the program writes lies beside it meanwhile.
            given: What it finds in the file ``given``, in its working directory.
        """
        scratch = root.with_name("reading")
        scratch.mkdir()
        (scratch / "given").write_text(given, encoding="ascii")
        try:
            outcome = self._run(root, scratch, arguments, ros, sandbox)
            return outcome, _plain_bytes(scratch / "kept")
        finally:
            shutil.rmtree(scratch, ignore_errors=True)

    def _run(
        self,
        root: Path,
        scratch: Path,
        arguments: Sequence[str],
        ros: RosInstallation,
        sandbox: Sandbox | None,
    ) -> Outcome:
        program = Path(__file__).with_name(self.program).read_text(encoding="utf-8")
        command = [sys.executable, "-I", "-c", program, *arguments]
        environment = {
            "PATH": os.defpath,
            "TMPDIR": str(scratch),
            "_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1",
        }

        def disk(_: object) -> str | None:
            size, _ = folder_usage((scratch,), BUILD.disk_bytes, BUILD.files)
            unpacked = f"it unpacks to more than {size_words(BUILD.disk_bytes)}"
            return unpacked if size > BUILD.disk_bytes else None

        excess: Callable[[Sequence[Usage]], str | None] = disk
        with ExitStack() as stack:
            if sandbox is not None:
                room = stack.enter_context(
                    sandbox.allowing(self.libraries).build(ros, (scratch, root), BUILD)
                )
                command, environment = room.command(command, environment), dict(room.environment)
                excess = room.excess
            bounded = Command(command, scratch, environment)
            return run_bounded(bounded, wall_s=self.wall_s, output=self.output, excess=excess)


def _plain_bytes(file: Path) -> bytes:
    """What is in a file of the program's; nothing if it is none, as a link to another file."""
    try:
        descriptor = os.open(file, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError:
        return b""
    with os.fdopen(descriptor, "rb") as stream:
        return stream.read() if stat.S_ISREG(os.fstat(descriptor).st_mode) else b""
