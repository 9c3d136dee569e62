"""Build a submission with ``colcon build`` in a scratch place, or take it from the cache.

setup.py and CMakeLists.txt are the student's programs: they run in processes of their own that
are bounded in time and output and leave nothing behind. What they may read and reach is the
business of a sandbox around them.
"""

from __future__ import annotations

import errno
import re
import shutil
import signal
import threading
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from grader.errors import GraderFault, machine_fault
from grader.out_of_memory import oom_kills
from grader.ros import RosInstallation
from grader.submission.build import build_log, standalone_build
from grader.submission.build.bounded import Outcome
from grader.submission.build.build_cache import INSTALL, BuildCache, CachedBuild
from grader.submission.build.build_error_location import Sources, find_build_error, last_started
from grader.submission.build.build_key import build_key
from grader.submission.build.build_limits import BuildLimits
from grader.submission.build.colcon import COMPILE_S, STOPPED, Colcon
from grader.submission.build.installed import tidy
from grader.submission.build.toolchain import missing_here, missing_tools
from grader.submission.intake.locate import Located, only
from grader.submission.intake.members import MIB
from grader.submission.read.rosdistro import PACKAGES
from grader.submission.record import BuildRecord

if TYPE_CHECKING:
    from grader.sandbox.sandbox import Sandbox

_T = TypeVar("_T")
_WHOLE_LOG = 60_000
_SUMMARY = re.compile(r"Summary: \d+ packages? finished")
_SIGNALLED = 128
# What colcon, Python, compilers and make say of a program of theirs that was killed.
_KILLED = re.compile(r"code -9\b|\bSIGKILL\b|\bKilled\b")
_LEAST_FREE_BYTES = 64 * MIB
# What makes the sandbox, each with its own complaint; colcon is only started by the last.
_NOT_STARTED = re.compile(r"(?:/\S*/)?(?:sh|unshare|mkdir|mount|setpriv|bwrap|prlimit): .*")


class BuildKilled(GraderFault):
    """A build was ended by a signal from outside; once more it may come to its end."""


def once_more(attempt: Callable[[bool], _T]) -> _T:
    """Build, and build again if the first build was killed.

    Args:
        attempt: Builds from the beginning; told whether it is the second time.
    """
    try:
        return attempt(False)
    except BuildKilled:
        return attempt(True)


def build(
    located: Located,
    sources: Sources,
    ros: RosInstallation,
    *,
    only_python: bool,
    cache: BuildCache,
    standalone: Sequence[str] = (),
    is_standalone: bool = False,
    limits: BuildLimits | None = None,
    on_progress: Callable[[str], None] = lambda _: None,
    sandbox: Sandbox | None = None,
    stop: threading.Event | None = None,
    on_output: Callable[[str], None] = lambda _: None,
    is_second: bool = False,
) -> CachedBuild:
    """Build all packages of a submission, unless just this was built before.

    Args:
        located: The submission; its private copy is where the build runs, so read from it what
            you need before.
        cache: Where builds are kept; failed ones too, but not those that were ended by the
            time limit.
        sandbox: What the build runs in, or None.

    Raises:
        BuildKilled: A signal ended it that no limit of ours sends.
        GraderFault: It could not be built here, for no fault of the student: colcon is missing,
            the disk is full.
    """
    limits = limits or BuildLimits()
    wall_s = limits.python_s if only_python else limits.other_s
    colcon = partial(
        Colcon,
        located.root,
        tuple(sources.folders.values()),
        ros=ros,
        only_python=only_python,
        is_standalone=is_standalone,
        limits=limits,
        wall_s=wall_s,
        on_progress=on_progress,
        sandbox=sandbox,
        stop=stop,
        on_output=on_output,
    )
    workshop = _Workshop(located, sources, ros, colcon, on_output, is_second)
    alone = partial(
        build,
        ros=ros,
        only_python=False,
        cache=cache,
        is_standalone=True,
        limits=limits,
        on_progress=on_progress,
        sandbox=sandbox,
        stop=stop,
        is_second=is_second,
    )
    terms = [*_terms(limits, sandbox), *(["apart"] if is_standalone else [])]
    key = build_key(located.sha256, ros, sandboxed=sandbox is not None, terms=terms)
    on_progress("looking for an earlier build")
    with cache.locked(key, wait_s=wall_s + COMPILE_S):
        found = cache.find(key)
        if found is not None:
            return found
        parts = dict(_parts(located, sources, standalone, alone))
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
            log = standalone_build.as_handed_in(built.build.log, name, folder)
            yield name, replace(built, build=replace(built.build, log=log))


@dataclass(frozen=True)
class _Workshop:
    """One build that is really run."""

    located: Located
    sources: Sources
    ros: RosInstallation
    colcon: Callable[[Path, Path], Colcon]
    on_output: Callable[[str], None]
    is_second: bool

    def build(self, install: Path, parts: Mapping[str, CachedBuild]) -> BuildRecord:
        # Beside the copy, so that relative paths in the log are the same on every run.
        scratch = self.located.root.with_name("scratch")
        scratch.mkdir()
        for name, part in parts.items():
            assert part.install is not None
            standalone_build.lay(name, part.install, install)
            for line in part.build.log.splitlines():
                self.on_output(line)
        finished = set(parts)
        # It is there before anything of the student's runs, who could else put a link in its place.
        install.mkdir(exist_ok=True)
        colcon = self.colcon(scratch, install)
        kills = oom_kills()
        check_python = colcon.sandbox.watched() if colcon.sandbox else None
        outcome = colcon.build(finished)
        if kills != oom_kills():
            _check_memory(outcome)
        self._check_machine(outcome, scratch, install)
        if check_python is not None and outcome.status != 0:
            check_python()
        limits = colcon.limits
        problem = tidy(
            install,
            self.located.root,
            most_bytes=limits.install_bytes,
            most_files=limits.install_files,
        )
        problem = problem or _ended_by_us(outcome, colcon.wall_s)
        record = self._record(outcome, finished, problem, scratch, install)
        record = _with_parts(record, parts.values())
        if finished:
            # Nodes then start without doing it.
            colcon.compile()
        else:
            # colcon writes its own setup files first.
            shutil.rmtree(install, ignore_errors=True)
        return record

    def _check_machine(self, outcome: Outcome, scratch: Path, install: Path) -> None:
        """Raise what is not the student's fault."""
        if outcome.ended_by_us:
            return
        killed = _signal_of(outcome)
        if killed is not None:
            raise BuildKilled(
                f"colcon was ended by {killed}, twice, which no limit of ours sends: "
                "perhaps somebody stopped it, or memory ran out; grade again"
            )
        if not self.is_second and outcome.status != 0 and _KILLED.search(outcome.output):
            # Perhaps by the build itself; then it happens again.
            raise BuildKilled("a program of the build was killed")
        unstarted = _NOT_STARTED.match(outcome.output) if outcome.status else None
        if unstarted and "Starting >>>" not in outcome.output:
            raise GraderFault(f"the sandbox of the build could not be started: {unstarted[0]}")
        if _is_cut_off(outcome.output, self.sources.folders):
            raise GraderFault(f"colcon ended with status {outcome.status} in the middle of a build")
        if outcome.status == 0:
            return
        if "No space left on device" in outcome.output:
            for place in (scratch, install.parent):
                full = machine_fault(OSError(errno.ENOSPC, "", str(place)))
                if full is not None and shutil.disk_usage(place).free < _LEAST_FREE_BYTES:
                    raise full

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
        log = build_log.clean(outcome.output, paths)
        failed = sorted(set(self.sources.folders) - finished)
        succeeded = outcome.status == 0 and not failed and problem is None
        culprit = None
        if not succeeded:
            culprit = find_build_error(log, failed, self.sources)
            culprit = culprit or last_started(log, self.sources, problem)
        if problem is not None:
            log += f"\n[rosgrade: {problem}]\n"
        return BuildRecord(
            succeeded=succeeded,
            duration_s=round(outcome.duration_s, 3),
            timed_out=outcome.ended_by_us == "time",
            failed_packages=tuple(failed),
            lacking=tuple(sorted(self._lacking(outcome.output))) if failed else (),
            culprit=culprit,
            log=build_log.ending(log),
        )

    def _lacking(self, output: str) -> set[str]:
        """What ROS 2 Jazzy has and is neither installed here nor handed in."""
        named = build_log.not_found(output)
        imported = {name for name in build_log.modules_not_found(output) if self._imports(name)}
        missing = (named | imported) & PACKAGES - self.ros.packages - set(self.sources.folders)
        tools = missing_tools(self.ros.environment({})["PATH"])
        return missing | missing_here(named) | set(tools)

    def _imports(self, module: str) -> bool:
        """Whether a setup.py really imports a module, whatever it prints."""
        statement = re.compile(rf"\s*(?:import|from)\s+{module}\b")
        texts = self.sources.texts.items()
        lines = (line for path, text in texts if path.endswith("setup.py") for line in text)
        return any(statement.match(line) for line in lines)


def _terms(limits: BuildLimits, sandbox: Sandbox | None) -> list[str]:
    """What else may decide whether a build succeeds, where it is not as usual."""
    usual = BuildLimits()
    terms = [repr(limits.output)] if limits.output != usual.output else []
    if sandbox is not None:
        terms += [repr(limits.room)] if limits.room != usual.room else []
        terms += sorted(sandbox.libraries)
    return terms


def _check_memory(outcome: Outcome) -> None:
    """Raise that a program of a build may be what the kernel ended for want of memory."""
    if not outcome.ended_by_us and outcome.status != 0 and _KILLED.search(outcome.output):
        raise GraderFault("this machine ran out of memory: a program of the build was killed")


def _signal_of(outcome: Outcome) -> str | None:
    """The signal that ended colcon, or None.

    In a sandbox no program of a build can send it one (see :func:`student_filter`), and none can
    write to its memory: see :data:`~grader.submission.build.colcon.UNTOUCHABLE`.
    """
    if outcome.status is None or _SUMMARY.search(outcome.output):
        # It came to its end, and ends with the status of what failed, such as sys.exit(137).
        return None
    # As a shell tells of a signal, and bubblewrap does.
    number = -outcome.status if outcome.status < 0 else outcome.status - _SIGNALLED
    if not 0 < number < signal.NSIG:
        return None
    # Few of the real-time signals have a name.
    return next((one.name for one in signal.Signals if one == number), f"signal {number}")


def _is_cut_off(output: str, packages: Collection[str]) -> bool:
    """Whether colcon started a package and never said how that ended, nor why it stopped."""
    if _SUMMARY.search(output):
        # It came to its end, so whatever it says nothing of was only named by a build file.
        return False
    started = set(re.findall(r"^Starting >>> (\S+)", output, re.MULTILINE)) & set(packages)
    ended = set(re.findall(r"^(?:Finished|Failed|Aborted) +<<< (\S+)", output, re.MULTILINE))
    # Of a very long log only the beginning and the end are there.
    return len(output) < _WHOLE_LOG and bool(started - ended) and STOPPED not in output


def _with_parts(record: BuildRecord, parts: Iterable[CachedBuild]) -> BuildRecord:
    """The record of a build together with what was built apart before."""
    builds = [part.build for part in parts]
    return replace(
        record,
        duration_s=round(record.duration_s + sum(one.duration_s for one in builds), 3),
        log=build_log.ending("".join(one.log for one in builds) + record.log),
    )


def _ended_by_us(outcome: Outcome, wall_s: float) -> str | None:
    if outcome.ended_by_us == "time":
        return f"the build was ended after {wall_s:.0f} s"
    if outcome.ended_by_us == "output":
        return "the build was ended because it wrote too much output"
    if outcome.ended_by_us is not None:
        return f"the build was ended because {outcome.ended_by_us}"
    return None
