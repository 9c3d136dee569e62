"""Build a submission with ``colcon build`` in a scratch place, or take it from the cache.

setup.py and CMakeLists.txt are the student's programs: they run in processes of their own that
are bounded in time and output and leave nothing behind. What they may read and reach is the
business of a sandbox around them.
"""

from __future__ import annotations

import os
import re
import shutil
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from grader.errors import GraderFault
from grader.ros import RosInstallation
from grader.sandbox.limits import BUILD, Limits
from grader.submission import apart, buildlog
from grader.submission.bounded import Outcome, OutputLimits, run_bounded
from grader.submission.build_cache import INSTALL, BuildCache, CachedBuild
from grader.submission.build_key import build_key
from grader.submission.culprit import Sources, find_culprit, last_started
from grader.submission.installed import site_packages, tidy
from grader.submission.locate import Located, only
from grader.submission.members import MIB
from grader.submission.record import BuildRecord
from grader.submission.rosdistro import PACKAGES
from grader.submission.toolchain import check_headers, check_toolchain

if TYPE_CHECKING:
    from grader.sandbox.sandbox import Sandbox

_CMAKE_INCLUDE = Path(__file__).with_name("wheels.cmake")
_PROGRESS = re.compile(r"(Starting >>>|Finished <<<) (\S+)")
_STOPPED = "Exception in job execution"
_UNSAID = "colcon could not build this package; the log says why"
_COMPILE_S = 60.0
_WHOLE_LOG = 60_000
_LEAST_FREE_BYTES = 64 * MIB


@dataclass(frozen=True)
class BuildLimits:
    """How much a build may take.

    Attributes:
        python_s: Wall time where all packages are ament_python.
        other_s: Wall time where one is not.
        install_bytes: Size of the install space.
        install_files: Number of files in it.
        output: What is kept of the log, and how much ends the build.
        room: What it may take in a sandbox.
    """

    python_s: float = 120.0
    other_s: float = 300.0
    install_bytes: int = 512 * MIB
    install_files: int = 20_000
    output: OutputLimits = field(default_factory=OutputLimits)
    room: Limits = BUILD


def build(
    located: Located,
    sources: Sources,
    ros: RosInstallation,
    *,
    only_python: bool,
    cache: BuildCache,
    built_apart: Sequence[str] = (),
    is_apart: bool = False,
    limits: BuildLimits | None = None,
    on_progress: Callable[[str], None] = lambda _: None,
    sandbox: Sandbox | None = None,
    stop: threading.Event | None = None,
    on_output: Callable[[str], None] = lambda _: None,
) -> CachedBuild:
    """Build all packages of a submission, unless just this was built before.

    Args:
        located: The submission; its private copy is where the build runs, so read from it what
            you need before.
        sources: Its packages and what is needed to find whom to blame.
        ros: Builds with this installation only.
        only_python: All packages are ament_python.
        cache: Where builds are kept; failed ones too, but not those that were ended by the
            time limit.
        built_apart: Packages that are built apart from the others, each of them kept as well.
        is_apart: This is one of them.
        limits: What is too much.
        on_progress: Told in a few words what happens.
        sandbox: What the build runs in, or None.
        stop: Ends the build from another thread when it is set.
        on_output: Called with each line of colcon's as it comes.

    Raises:
        GraderFault: It could not be built here, for no fault of the student: colcon or a
            package of Jazzy is missing, the disk is full.
    """
    limits = limits or BuildLimits()
    wall_s = limits.python_s if only_python else limits.other_s
    workshop = _Workshop(
        located,
        sources,
        ros,
        limits,
        only_python,
        is_apart,
        wall_s,
        on_progress,
        sandbox,
        stop,
        on_output,
    )
    alone = partial(
        build,
        ros=ros,
        only_python=False,
        cache=cache,
        is_apart=True,
        limits=limits,
        on_progress=on_progress,
        sandbox=sandbox,
        stop=stop,
    )
    terms = [*_terms(limits, sandbox), *(["apart"] if is_apart else [])]
    key = build_key(located.sha256, ros, sandboxed=sandbox is not None, terms=terms)
    on_progress("looking for an earlier build")
    with cache.locked(key, wait_s=wall_s + _COMPILE_S):
        found = cache.find(key)
        if found is not None:
            return found
        parts = dict(_parts(located, sources, built_apart, alone))
        with cache.unfinished() as unfinished:
            record = workshop.build(unfinished / INSTALL, parts)
            if record.timed_out:
                return CachedBuild(record, None)
            return cache.store(key, unfinished, record)


def _parts(
    located: Located,
    sources: Sources,
    names: Iterable[str],
    build_alone: Callable[[Located, Sources], CachedBuild],
) -> Iterator[tuple[str, CachedBuild]]:
    """Build packages apart from the others, or take them from the cache.

    One that does not build alone is left out: it is built with the others, which also tells the
    student why it fails.
    """
    for name in names:
        folder = sources.folders[name]
        with only(located, folder, name) as part:
            files = {file.path for file in part.files}
            built = build_alone(part, Sources(files, {name: name}))
        if built.build.succeeded and built.install is not None:
            log = apart.as_handed_in(built.build.log, name, folder)
            yield name, replace(built, build=replace(built.build, log=log))


@dataclass(frozen=True)
class _Workshop:
    """One build that is really run."""

    located: Located
    sources: Sources
    ros: RosInstallation
    limits: BuildLimits
    only_python: bool
    is_apart: bool
    wall_s: float
    on_progress: Callable[[str], None]
    sandbox: Sandbox | None = None
    stop: threading.Event | None = None
    on_output: Callable[[str], None] = lambda _: None

    def build(self, install: Path, parts: Mapping[str, CachedBuild]) -> BuildRecord:
        # Beside the copy, so that relative paths in the log are the same on every run.
        scratch = self.located.root.with_name("scratch")
        scratch.mkdir()
        environment = self._environment(scratch)
        for name, part in parts.items():
            assert part.install is not None
            apart.lay(name, part.install, install)
            for line in part.build.log.splitlines():
                self.on_output(line)
        finished = set(parts)
        outcome = self._colcon_build(environment, scratch, install, finished)
        self._check_machine(outcome, scratch, install)
        problem = tidy(
            install, most_bytes=self.limits.install_bytes, most_files=self.limits.install_files
        )
        problem = problem or _ended_by_us(outcome, self.wall_s)
        record = self._record(outcome, finished, problem, scratch, install)
        record = _with_parts(record, parts.values())
        if finished:
            self._compile(environment, install, scratch)
        else:
            # colcon writes its own setup files first.
            shutil.rmtree(install, ignore_errors=True)
        return record

    def _colcon_build(
        self, environment: Mapping[str, str], scratch: Path, install: Path, finished: set[str]
    ) -> Outcome:
        """Build what can be built; the names of the packages are added to ``finished``."""
        started: set[str] = set()

        def on_line(line: str) -> None:
            self.on_output(line)
            match = _PROGRESS.match(line)
            if match and match[1].startswith("Finished"):
                finished.add(match[2])
            elif match:
                started.add(match[2])
                self.on_progress(f"building {match[2]}")

        failed: set[str] = set()
        outcomes: list[Outcome] = []
        while True:
            command = self._command(environment, scratch, install)
            if failed or finished:
                command += ["--packages-skip", *sorted(failed | finished)]
            if failed:
                command += ["--packages-skip-by-dep", *sorted(failed)]
            outcome = self._run(
                command,
                environment,
                scratch,
                install,
                self.wall_s - sum(item.duration_s for item in outcomes),
                on_line,
            )
            outcomes.append(outcome)
            # Where setup.py raises before anything is built, colcon's executor stops with the
            # exception, whatever --continue-on-error says; the others are still to be built.
            stopped = not outcome.ended_by_us and _STOPPED in outcome.output
            if not stopped or started - finished <= failed:
                return _together(outcomes)
            failed = started - finished

    def _environment(self, scratch: Path) -> dict[str, str]:
        """Variables of a build; none of the caller's, on which what is kept would depend."""
        environment = self.ros.environment({})
        for name in ("HOME", "TMPDIR", "COLCON_HOME"):
            folder = scratch / name.lower()
            folder.mkdir()
            environment[name] = str(folder)
        # Messages of CMake and the compiler are searched for whom to blame.
        environment["LC_ALL"] = "C.UTF-8"
        return environment

    def _command(self, environment: Mapping[str, str], scratch: Path, install: Path) -> list[str]:
        folders = [str(self.located.root / folder) for folder in self.sources.folders.values()]
        command = [*_colcon(self.ros, environment["PATH"]), "--log-base", os.devnull, "build"]
        command += ["--merge-install", "--continue-on-error", "--executor", "sequential"]
        command += ["--build-base", str(scratch / "build"), "--install-base", str(install)]
        command += ["--event-handlers", "console_direct+", "console_cohesion-", "console_stderr-"]
        command += ["--base-paths", *folders]
        if not self.only_python:
            check_toolchain(environment["PATH"])
            # Linters and test frameworks are not there to be found on a small installation.
            command += ["--cmake-args", "-DBUILD_TESTING=OFF"]
            # Quicker than make, but stricter with rules that a student may have written; of these
            # an interface package has none.
            if self.is_apart and shutil.which("ninja", path=environment["PATH"]):
                command += ["-GNinja"]
            if self.ros.source == "wheels":
                # Where a sandbox shows it, too.
                include = shutil.copy(_CMAKE_INCLUDE, scratch)
                command += [f"-DCMAKE_PROJECT_INCLUDE={include}"]
        return command

    def _check_machine(self, outcome: Outcome, scratch: Path, install: Path) -> None:
        """Raise what is not the student's fault."""
        if outcome.status == 0 or outcome.ended_by_us:
            return
        if outcome.status is not None and outcome.status < 0:
            raise GraderFault(
                f"colcon was killed by signal {-outcome.status}; perhaps memory ran out"
            )
        if outcome.status is not None and _is_cut_off(outcome.output):
            raise GraderFault(f"colcon ended with status {outcome.status} in the middle of a build")
        if "No space left on device" in outcome.output:
            free = min(shutil.disk_usage(path).free for path in (scratch, install.parent))
            if free < _LEAST_FREE_BYTES:
                raise GraderFault("the disk is full: the submission could not be built")
        check_headers(outcome.output)
        lacking = buildlog.missing_cmake_packages(outcome.output) & PACKAGES
        lacking -= self.ros.packages | set(self.sources.folders)
        if lacking:
            raise GraderFault(
                "this ROS installation lacks what the submission needs to build: "
                f"{', '.join(sorted(lacking))}; use a full ROS 2 {self.ros.distro}"
            )

    def _record(
        self,
        outcome: Outcome,
        finished: set[str],
        problem: str | None,
        scratch: Path,
        install: Path,
    ) -> BuildRecord:
        paths = {
            str(self.located.root): "",
            str(scratch / "build"): "build",
            str(install): "install",
            str(scratch): "scratch",
        }
        log = buildlog.clean(outcome.output, paths)
        failed = sorted(set(self.sources.folders) - finished)
        succeeded = outcome.status == 0 and not failed and problem is None
        culprit = None
        if not succeeded:
            culprit = find_culprit(log, failed, self.sources)
            culprit = culprit or last_started(log, self.sources, problem or _UNSAID)
        if problem is not None:
            log += f"\n[rosgrade: {problem}]\n"
        return BuildRecord(
            succeeded=succeeded,
            duration_s=round(outcome.duration_s, 3),
            timed_out=outcome.ended_by_us == "time",
            failed_packages=tuple(failed),
            culprit=culprit,
            log=buildlog.ending(log),
        )

    def _compile(self, environment: Mapping[str, str], install: Path, scratch: Path) -> None:
        """Compile what the build installed, so that nodes start without doing it."""
        folders = [str(path) for path in site_packages(install)]
        if folders:
            command = [str(self.ros.python), "-I", "-S", "-m", "compileall", "-qq", *folders]
            self._run(command, environment, scratch, install, _COMPILE_S)

    def _run(
        self,
        command: Sequence[str],
        environment: Mapping[str, str],
        scratch: Path,
        install: Path,
        wall_s: float,
        on_line: Callable[[str], None] | None = None,
    ) -> Outcome:
        """Run a part of the build, in the sandbox if there is one."""
        run = partial(
            run_bounded, cwd=scratch, wall_s=wall_s, output=self.limits.output, on_line=on_line
        )
        if self.sandbox is None:
            return run(command, environment=environment, excess=self._watched())
        folders = (scratch, self.located.root, install.parent)
        with self.sandbox.build(self.ros, folders, self.limits.room) as room:
            return run(
                room.command(command, environment),
                environment=room.environment,
                excess=self._watched(room.excess),
            )

    def _watched(
        self, excess: Callable[[int], str | None] = lambda _: None
    ) -> Callable[[int], str | None]:
        """Look for a passed limit, and for whoever wants the build to end."""

        def look(pid: int) -> str | None:
            if self.stop is not None and self.stop.is_set():
                raise GraderFault("interrupted")
            return excess(pid)

        return look


def _terms(limits: BuildLimits, sandbox: Sandbox | None) -> list[str]:
    """What else may decide whether a build succeeds, where it is not as usual."""
    usual = BuildLimits()
    terms = [repr(limits.output)] if limits.output != usual.output else []
    if sandbox is not None:
        terms += [repr(limits.room)] if limits.room != usual.room else []
        terms += sorted(sandbox.libraries)
    return terms


def _is_cut_off(output: str) -> bool:
    """Whether colcon started a package and never said how that ended, nor why it stopped."""
    started = set(re.findall(r"^Starting >>> (\S+)", output, re.MULTILINE))
    ended = set(re.findall(r"^(?:Finished|Failed|Aborted) +<<< (\S+)", output, re.MULTILINE))
    # Of a very long log only the beginning and the end are there.
    return len(output) < _WHOLE_LOG and bool(started - ended) and _STOPPED not in output


def _together(outcomes: Sequence[Outcome]) -> Outcome:
    """One outcome of several commands: it succeeded if all did."""
    last = outcomes[-1]
    return Outcome(
        status=next((item.status for item in outcomes if item.status), last.status),
        ended_by_us=last.ended_by_us,
        output="".join(item.output for item in outcomes),
        duration_s=sum(item.duration_s for item in outcomes),
    )


def _with_parts(record: BuildRecord, parts: Iterable[CachedBuild]) -> BuildRecord:
    """The record of a build together with what was built apart before."""
    builds = [part.build for part in parts]
    return replace(
        record,
        duration_s=round(record.duration_s + sum(one.duration_s for one in builds), 3),
        log=buildlog.ending("".join(one.log for one in builds) + record.log),
    )


def _colcon(ros: RosInstallation, path: str) -> list[str]:
    beside = ros.python.parent / "colcon"
    if beside.exists():
        return [str(ros.python), str(beside)]
    found = shutil.which("colcon", path=path)
    if found is None:
        raise GraderFault(
            "colcon is not installed: apt install python3-colcon-common-extensions, "
            "or install the wheels with pip install 'rosgrade[ros]'"
        )
    return [found]


def _ended_by_us(outcome: Outcome, wall_s: float) -> str | None:
    if outcome.ended_by_us == "time":
        return f"the build was ended after {wall_s:.0f} s"
    if outcome.ended_by_us == "output":
        return "the build was ended because it wrote too much output"
    if outcome.ended_by_us is not None:
        return f"the build was ended because {outcome.ended_by_us}"
    return None
