"""``colcon build`` and the other programs of a build, within limits and in the sandbox."""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import shutil
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from grader.errors import GraderFault
from grader.machine.ros import RosInstallation, site_packages
from grader.machine.tree import MOST_DEEP, cut_deep
from grader.sandbox.limits import BUILD, SandboxLimits
from grader.sandbox.usage import Usage
from grader.submission.build import build_log, own_tests
from grader.submission.build.bounded import Command, Outcome, OutputLimits, run_bounded
from grader.submission.intake.members import MIB

if TYPE_CHECKING:
    from grader.sandbox.sandbox import Sandbox

COMPILE_S = 60.0
_COMPILER_BYTES = 1024 * MIB
"""A compiler takes 750 MiB for a file that includes rclcpp."""
_USABLE = 0.875
"""Share of the memory that builds may have together; the rest is for all else."""
UNTOUCHABLE = """\
import ctypes, os, runpy, sys
ctypes.CDLL(None).prctl(4, 0, 0, 0, 0)
sys.argv.pop(0)
sys.path[0] = os.path.dirname(sys.argv[0])
runpy.run_path(sys.argv[0], run_name="__main__")
"""
"""Runs a Python program whose memory no other process can reach: PR_SET_DUMPABLE, prctl(2)."""
_CMAKE_INCLUDE = Path(__file__).with_name("wheels.cmake")
_PROGRESS = re.compile(r"(Starting|Finished|Failed|Aborted) +(?:>>>|<<<) (\S+)")


@dataclass(frozen=True)
class BuildLimits:
    """How much a build may take: its own time (:class:`OwnTime`), and space.

    Attributes:
        python_s: Time where all packages are pure Python; else ``other_s``.
    """

    python_s: float = 120.0
    other_s: float = 300.0
    install_bytes: int = 512 * MIB
    install_files: int = 20_000
    output: OutputLimits = field(default_factory=OutputLimits)
    room: SandboxLimits = BUILD


@dataclass(frozen=True, kw_only=True)
class BuildSetting:
    """Settings of builds: ROS, limits, sandbox, and what is called with their progress.

    Attributes:
        sandbox: What everything runs in, or None.
        stop: Set when the builds are no longer wanted.
        on_output: Called with each line of the log as it comes.
        tested: Packages whose own tests are run after the build.
    """

    ros: RosInstallation
    limits: BuildLimits = field(default_factory=BuildLimits)
    sandbox: Sandbox | None = None
    stop: threading.Event | None = None
    on_progress: Callable[[str], None] = lambda _: None
    on_output: Callable[[str], None] = lambda _: None
    tested: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Colcon:
    """colcon for one submission, with a scratch folder for what a build leaves behind.

    Attributes:
        folders: Of each package, by its name.
    """

    setting: BuildSetting
    root: Path
    folders: Mapping[str, str]
    scratch: Path
    install: Path
    only_python: bool
    is_standalone: bool
    wall_s: float

    def build(self, finished: set[str]) -> Outcome:
        """Build what can be built, and add it to the packages that are finished already.

        What compiles waits until there is memory for it.
        """
        if self.only_python:
            return self._build(finished)
        with _compiling(self.setting.limits.room.memory_bytes):
            return self._build(finished)

    def _build(self, finished: set[str]) -> Outcome:
        def on_output(text: str) -> None:
            for line in build_log.own_lines(text).split("\n"):
                self.setting.on_output(line)
                match = _PROGRESS.match(line)
                if match is None:
                    continue
                if match[1] == "Finished":
                    finished.add(match[2])
                elif match[1] == "Starting":
                    self.setting.on_progress(f"building {match[2]}")
                else:
                    # The last such line is colcon's own, even if a package printed one before.
                    finished.discard(match[2])

        command = self._command()
        if finished:
            command += ["--packages-skip", *sorted(finished)]
        outcome = self._run(command, self.wall_s, on_output)
        return replace(outcome, output=build_log.own_lines(outcome.output))

    def compile(self) -> None:
        """Compile what the build installed, so that nodes start without doing it."""
        folders = [str(path) for path in site_packages(self.install)]
        if folders:
            options = ["-I", "-S", "-m", "compileall", "-qq"]
            self._run([str(self.setting.ros.python), *options, *folders], COMPILE_S)

    def test(self, folder: str) -> tuple[Outcome, str]:
        """Run the tests of a package that was built; also where it lies, as pytest names it."""
        python, place = str(self.setting.ros.python), str(self.root / folder)
        command = [python, "-m", own_tests.LIBRARY, *own_tests.pytest_options(place)]
        overlaid = self.setting.ros.environment({}, (self.install,))
        variables = {**self.environment, **overlaid, "COLUMNS": own_tests.COLUMNS}
        outcome = self._run(command, own_tests.WALL_S, variables=variables)
        return outcome, os.path.relpath(place, self.scratch)

    @cached_property
    def environment(self) -> dict[str, str]:
        """Variables of a build; none of the caller's, on which what is kept would depend."""
        environment = self.setting.ros.environment({})
        for name in ("HOME", "TMPDIR", "COLCON_HOME"):
            folder = self.scratch / name.lower()
            folder.mkdir()
            environment[name] = str(folder)
        # Messages of CMake and the compiler are searched for the place of an error.
        environment["LC_ALL"] = "C.UTF-8"
        # With as many at once as there are CPUs, which is the default, a build would take more
        # memory on a machine with more of them.
        compilers = self.setting.limits.room.memory_bytes // _COMPILER_BYTES
        environment["MAKEFLAGS"] = f"-j{max(1, min(compilers, len(os.sched_getaffinity(0))))}"
        # What others made, and what is generated, is not debugged.
        if not self.is_standalone:
            environment |= dict.fromkeys(("CFLAGS", "CXXFLAGS"), self._compiler_flags())
        return environment

    def _compiler_flags(self) -> str:
        """Quick to compile, with lines of functions for a crash; a package may say otherwise.

        Debug information and ``__FILE__`` name the student's files as they were handed in. The
        compiler takes the last option that fits: of two names, the longer one.
        """
        builds = [str(self.scratch / "build" / name) for name in sorted(self.folders, key=len)]
        places = [f"-ffile-prefix-map={place}=" for place in (f"{self.root}/", *builds)]
        return shlex.join(["-O0", "-g1", *places])

    def _command(self) -> list[str]:
        command = [
            *_colcon(self.setting.ros, self.environment["PATH"]),
            *("--log-base", os.devnull, "build", "--merge-install", "--continue-on-error"),
            # Unlike the sequential one it goes on where a setup.py raises before a build begins.
            *("--executor", "parallel", "--parallel-workers", "1"),
            *("--build-base", str(self.scratch / "build")),
            *("--install-base", str(self.install)),
            *("--event-handlers", "console_direct+", "console_cohesion-", "console_stderr-"),
            "parallel_status-",
            *("--base-paths", *(str(self.root / folder) for folder in self.folders.values())),
        ]
        if not self.only_python:
            # Linters and test frameworks are not there to be found on a small installation.
            command += ["--cmake-args", "-DBUILD_TESTING=OFF"]
            # Quicker than make, but stricter with rules that a student may have written; where it
            # fails, the package is built with the others.
            if self.is_standalone and shutil.which("ninja", path=self.environment["PATH"]):
                command += ["-GNinja"]
            if self.setting.ros.source == "wheels":
                command += [f"-DCMAKE_PROJECT_INCLUDE={self._include}"]
        return command

    @cached_property
    def _include(self) -> Path:
        """A file for CMake, copied before the student's code could put a link in its place."""
        return Path(shutil.copy(_CMAKE_INCLUDE, self.scratch))

    def _run(
        self,
        command: Sequence[str],
        wall_s: float,
        on_line: Callable[[str], None] | None = None,
        variables: Mapping[str, str] | None = None,
    ) -> Outcome:
        """Run a part of the build, in the sandbox if there is one."""
        setting = self.setting
        # Not the folder around the install space: rosgrade writes there afterwards, and would
        # follow a link that was left there.
        folders = (self.scratch, self.root, self.install)
        with contextlib.ExitStack() as stack:
            room = None
            environment = variables or self.environment
            if setting.sandbox is not None:
                room = stack.enter_context(
                    setting.sandbox.build(setting.ros, folders, setting.limits.room)
                )
                command, environment = room.command(command, environment), room.environment

            def excess(usages: Sequence[Usage]) -> str | None:
                if setting.stop is not None and setting.stop.is_set():
                    raise GraderFault("interrupted")
                return room.excess(usages) if room else None

            try:
                outcome = run_bounded(
                    Command(command, self.scratch, environment),
                    wall_s=wall_s,
                    output=setting.limits.output,
                    on_line=on_line,
                    excess=excess,
                )
            finally:
                # Nothing that walks through the folders afterwards could come to the end of these.
                deep = [folder for folder in folders if cut_deep(folder)]
        if not deep or outcome.ended_by_us:
            return outcome
        return replace(outcome, ended_by_us=f"it nested folders more than {MOST_DEEP} deep")


def builds_at_once(memory_bytes: int, each_bytes: int) -> int:
    """How many builds that compile fit into the memory of a machine; at least one."""
    return max(1, int(_USABLE * memory_bytes) // each_bytes)


@cache
def _compiling(each_bytes: int) -> threading.BoundedSemaphore:
    """Places for the builds of this process that may take so much memory each."""
    memory_bytes = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return threading.BoundedSemaphore(builds_at_once(memory_bytes, each_bytes))


def _colcon(ros: RosInstallation, path: str) -> list[str]:
    beside = ros.python.parent / "colcon"
    if beside.exists():
        return [str(ros.python), "-c", UNTOUCHABLE, str(beside)]
    found = shutil.which("colcon", path=path)
    if found is None:
        raise GraderFault(
            "colcon is not installed: apt install python3-colcon-common-extensions, "
            "or install the wheels with pip install 'rosgrade[ros]'"
        )
    return [found]
