"""Build a submission with ``colcon build`` in a scratch place, or take it from the cache.

setup.py and CMakeLists.txt are the student's programs: they run in processes of their own that
are bounded in time and output and leave nothing behind. What they may read and reach is the
business of a sandbox around them.
"""

from __future__ import annotations

import errno
import hashlib
import json
import re
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from grader.errors import GraderFault, machine_fault
from grader.machine.out_of_memory import oom_kills
from grader.machine.resources import INSTALL
from grader.machine.ros import RosInstallation
from grader.recording.submission import BuildRecord
from grader.submission.build import build_log, own_tests, standalone_build
from grader.submission.build.bounded import Outcome, Starved
from grader.submission.build.build_cache import BuildCache, CachedBuild
from grader.submission.build.build_error_location import Sources, find_build_error, last_started
from grader.submission.build.colcon import COMPILE_S, BuildLimits, BuildSetting, Colcon
from grader.submission.build.installed import tidy
from grader.submission.build.ros_damage import damaged, state_of
from grader.submission.build.toolchain import missing_here, missing_tools, watched_folders
from grader.submission.intake.locate import Located, only
from grader.submission.intake.members import MIB
from grader.submission.read.rosdistro import PACKAGES

if TYPE_CHECKING:
    from grader.sandbox.sandbox import Sandbox

_T = TypeVar("_T")
# Raise it when the same submission would now be built differently.
_VERSION = 7
_TOOLS = ("cc", "c++", "cmake", "ld", "make", "ninja")
_SUMMARY = re.compile(r"Summary: \d+ packages? finished")
_SIGNALLED = 128
# What colcon, Python, compilers and make say of a program of theirs that was killed.
_KILLED = re.compile(r"code -9\b|\bSIGKILL\b|\bKilled\b")
_LEAST_FREE_BYTES = 64 * MIB
# Error messages of the programs that set up a sandbox, the last of which starts colcon.
_NOT_STARTED = re.compile(r"(?:/\S*/)?(?:sh|unshare|mkdir|mount|setpriv|bwrap|prlimit): .*")


def build_key(
    sha256: str,
    ros: RosInstallation,
    limits: BuildLimits,
    sandbox: Sandbox | None,
    is_standalone: bool,
    tested: frozenset[str] = frozenset(),
) -> str:
    """Name a build by everything that it depends on."""
    watched = [prefix / "share/ament_index/resource_index/packages" for prefix in ros.prefixes]
    # colcon and setuptools come with ROS, too.
    watched += [ros.python, *ros.site_packages, *watched_folders()]
    # What compiles and links, behind all links such as /etc/alternatives.
    found = (shutil.which(name, path=ros.environment({})["PATH"]) for name in _TOOLS)
    watched += [Path(tool).resolve() for tool in found if tool is not None]
    parts = [
        _VERSION,
        sha256,
        ros.source,
        ros.distro,
        str(ros.python),
        [str(prefix) for prefix in ros.prefixes],
        ros.inherited,
        # An underlay is an install space in the cache, below the name of its build.
        [str(underlay) for underlay in ros.underlays],
        [(str(path), path.stat().st_mtime_ns) for path in watched if path.exists()],
        sorted(ros.packages),
        repr((limits.output, limits.room)),
        sorted(sandbox.libraries) if sandbox is not None else None,
        is_standalone,
        sorted(tested),
    ]
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


class BuildKilled(GraderFault):
    """A build was ended from outside; once more it may come to its end."""


def once_more(attempt: Callable[[bool], _T]) -> _T:
    """Build, and build again if the machine ended the first build, or had no time for it."""
    try:
        return attempt(False)
    except (BuildKilled, Starved):
        return attempt(True)


@dataclass(frozen=True)
class Builder:
    """Builds submissions in one setting, or takes them from the cache.

    The cache keeps failed builds, too, where it is certain that the reason is the student's.
    """

    setting: BuildSetting
    cache: BuildCache
    is_second: bool = False

    def build(
        self,
        located: Located,
        sources: Sources,
        *,
        only_python: bool,
        standalone: Sequence[str] = (),
        is_standalone: bool = False,
        key: str | None = None,
    ) -> CachedBuild:
        """Build all packages of a submission, unless just this was built before.

        Args:
            located: The submission; the build runs in its private copy and may change it.
            standalone: Packages that are built for themselves, as if handed in alone.
            key: Name of the build in the cache; by default all that it depends on is in it.

        Raises:
            BuildKilled: The build was ended, although it was within its limits.
        """
        wall_s = self.setting.limits.python_s if only_python else self.setting.limits.other_s
        if key is None:
            key = build_key(
                located.sha256,
                self.setting.ros,
                self.setting.limits,
                self.setting.sandbox,
                is_standalone,
                self.setting.tested,
            )
        self.setting.on_progress("looking for an earlier build")
        with self.cache.locked(key, wait_s=wall_s + COMPILE_S):
            state = partial(state_of, self.setting.ros)
            found = self.cache.find(key, state)
            if found is not None:
                return found
            parts = dict(self._parts(located, sources, standalone))
            with self.cache.unfinished() as unfinished:
                # Beside the copy, so that relative paths in the log are the same on every run.
                scratch = located.root.with_name("scratch")
                scratch.mkdir()
                colcon = Colcon(
                    self.setting,
                    located.root,
                    sources.folders,
                    scratch,
                    unfinished / INSTALL,
                    only_python=only_python,
                    is_standalone=is_standalone,
                    wall_s=wall_s,
                )
                record, is_certain = self._run(colcon, sources, parts)
                seen_with = None if record.succeeded else state() if is_certain else ""
                return self.cache.store(key, unfinished, record, seen_with)

    def _parts(
        self, located: Located, sources: Sources, names: Sequence[str]
    ) -> Iterator[tuple[str, CachedBuild]]:
        """Build packages for themselves, or take them from the cache.

        One that does not build alone is left out: it is built with the others, which also tells
        the student why it fails.
        """
        setting = replace(self.setting, on_output=lambda _: None, tested=frozenset())
        quiet = replace(self, setting=setting)
        for name in names:
            with only(located, sources.folders[name], name) as part:
                files = {file.path for file in part.files}
                built = quiet.build(
                    part, Sources(files, {name: name}), only_python=False, is_standalone=True
                )
            if built.build.succeeded and built.install is not None:
                yield name, built

    def _run(
        self, colcon: Colcon, sources: Sources, parts: Mapping[str, CachedBuild]
    ) -> tuple[BuildRecord, bool]:
        """Build without a look into the cache; also whether it would come to the same again."""
        install = colcon.install
        for name, part in parts.items():
            assert part.install is not None
            standalone_build.lay(name, part.install, install)
            for line in part.build.log.splitlines():
                self.setting.on_output(line)
        finished = set(parts)
        # Made before the student's code runs, which could otherwise put a link in its place.
        install.mkdir(exist_ok=True)
        kills = oom_kills()
        check_python = self.setting.sandbox.watched() if self.setting.sandbox else None
        outcome = colcon.build(finished)
        self._check_machine(outcome, colcon, memory_ran_out=kills != oom_kills())
        if check_python is not None and outcome.status != 0:
            check_python()
        problem = tidy(
            install,
            colcon.root,
            most_bytes=self.setting.limits.install_bytes,
            most_files=self.setting.limits.install_files,
        )
        if problem is not None:
            # Nothing of it is there any more.
            finished.clear()
        problem = problem or _limit(outcome, colcon.wall_s)
        failed = sources.folders.keys() - finished
        record, is_certain = self._record(outcome, colcon, sources, failed, problem)
        if finished:
            # Nodes then start without doing it.
            colcon.compile()
        else:
            # colcon writes its own setup files first.
            shutil.rmtree(install, ignore_errors=True)
        builds = [part.build for part in parts.values()]
        record = replace(
            record,
            tests=tuple(
                own_tests.pytest_record(name, *colcon.test(sources.folders[name]))
                for name in sorted(self.setting.tested & finished)
            ),
            duration_s=round(record.duration_s + sum(one.duration_s for one in builds), 3),
            log=build_log.ending("".join(one.log for one in builds) + record.log),
        )
        return record, is_certain

    def _check_machine(self, outcome: Outcome, colcon: Colcon, *, memory_ran_out: bool) -> None:
        """Raise an error for a failure that is not the student's fault."""
        status, output = outcome.status, outcome.output
        if status is None:
            return
        killed = status != 0 and _KILLED.search(output)
        if killed and memory_ran_out:
            raise GraderFault("this machine ran out of memory: a program of the build was killed")
        unstarted = _NOT_STARTED.match(output) if status else None
        if unstarted and "Starting >>>" not in output:
            raise GraderFault(f"the sandbox of the build could not be started: {unstarted[0]}")
        # A program of the build may also kill itself; then it does so again.
        if _is_cut_off(status, output) or (killed and not self.is_second):
            raise BuildKilled(
                f"colcon ended in the middle of a build (status {status}), twice, although the "
                "build was within its limits. Was it stopped, or did memory run out? Grade again"
            )
        if status != 0 and "No space left on device" in output:
            for place in (colcon.scratch, colcon.install.parent):
                full = machine_fault(OSError(errno.ENOSPC, "", str(place)))
                if full is not None and shutil.disk_usage(place).free < _LEAST_FREE_BYTES:
                    raise full

    def _record(
        self,
        outcome: Outcome,
        colcon: Colcon,
        sources: Sources,
        failed: set[str],
        problem: str | None,
    ) -> tuple[BuildRecord, bool]:
        ros = [*self.setting.ros.underlays, *self.setting.ros.prefixes]
        paths = {
            str(colcon.root): "",
            str(colcon.scratch / "build"): "build",
            str(colcon.install): "install",
            str(colcon.scratch): "scratch",
            **{str(prefix): build_log.ROS for prefix in ros},
        }
        log = build_log.clean(outcome.output, paths)
        succeeded = outcome.status == 0 and not failed and problem is None
        lacking = self._lacking(log, sources) if failed else set()
        culprit = None if succeeded else find_build_error(log, failed, sources)
        timed_out = outcome.ended_by_us == "time"
        is_certain = not timed_out and not lacking and not (culprit is None and problem is None)
        if not succeeded and culprit is None:
            culprit = last_started(log, sources, problem)
        log = build_log.folded(log)
        if problem is not None:
            log += f"\n[rosgrade: {problem}]\n"
        record = BuildRecord(
            succeeded=succeeded,
            duration_s=outcome.duration_s,
            timed_out=timed_out,
            waited=outcome.waited if timed_out else None,
            failed_packages=tuple(sorted(failed)),
            lacking=tuple(sorted(lacking)),
            culprit=culprit,
            log=log,
        )
        return record, is_certain

    def _lacking(self, log: str, sources: Sources) -> set[str]:
        """What ROS 2 Jazzy has and is neither handed in nor whole on this machine."""
        named = build_log.not_found(log)
        wanted = named | build_log.modules_not_found(log)
        missing = wanted & PACKAGES - self.setting.ros.packages - set(sources.folders)
        tools = missing_tools(self.setting.ros.environment({})["PATH"])
        return (
            missing
            | missing_here(named)
            | set(tools)
            | damaged(log, self.setting.ros, sources.folders)
        )


def _is_cut_off(status: int, output: str) -> bool:
    """Whether colcon ended without coming to its end.

    In a sandbox no program of a build can send it a signal (see :func:`student_filter`), and none
    can write to its memory: see :data:`~grader.submission.build.colcon.UNTOUCHABLE`.
    """
    if _SUMMARY.search(output):
        # It ends with the status of what failed, such as sys.exit(137).
        return False
    # As a shell tells of a signal, and bubblewrap does.
    if status < 0 or status > _SIGNALLED:
        return True
    return "Starting >>>" in output


def _limit(outcome: Outcome, wall_s: float) -> str | None:
    """The limit that a build passed, in words for the student."""
    if outcome.ended_by_us is None:
        return None
    waited = "it waited for something" if outcome.waited else "it was still computing"
    reasons = {
        "time": f"after {wall_s:.0f} s: {waited}",
        "output": "because it wrote too much output",
    }
    reason = reasons.get(outcome.ended_by_us, f"because {outcome.ended_by_us}")
    return f"the build was ended {reason}"
