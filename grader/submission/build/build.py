"""Build a submission with ``colcon build`` in a scratch place, or take it from the cache.

setup.py and CMakeLists.txt are the student's programs: they run in processes of their own that
are bounded in time and output and leave nothing behind. What they may read and reach is the
business of a sandbox around them.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple, TypeVar

from grader.machine.out_of_memory import oom_kills
from grader.machine.resources import INSTALL
from grader.recording.submission import BuildRecord
from grader.submission.build import build_log, own_tests, standalone_build
from grader.submission.build.bounded import Outcome, Starved
from grader.submission.build.build_cache import BuildCache, CachedBuild
from grader.submission.build.build_error_location import Sources, find_build_error, last_started
from grader.submission.build.build_key import build_key
from grader.submission.build.colcon import COMPILE_S, BuildSetting, Colcon
from grader.submission.build.ended import BuildKilled, check_machine, passed_limit
from grader.submission.build.ros_damage import damaged, state_of
from grader.submission.build.tidy import tidy
from grader.submission.build.toolchain import missing_here, missing_tools
from grader.submission.intake.locate import Located, only
from grader.submission.read.rosdistro import PACKAGES

_T = TypeVar("_T")


def once_more(attempt: Callable[[bool], _T]) -> _T:
    """Build, and build again if the machine ended the first build, or had no time for it."""
    try:
        return attempt(False)
    except (BuildKilled, Starved):
        return attempt(True)


class _Built(NamedTuple):
    """A build without the cache, and whether it would come to the same again on this machine."""

    record: BuildRecord
    is_certain: bool


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
            earlier = self.cache.find(key, state)
            if earlier is not None:
                return earlier
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
                # A success holds for every state of the machine, a failure for this one only,
                # and a failure for an uncertain reason is not taken again.
                seen_with = None
                if not record.succeeded:
                    seen_with = state() if is_certain else ""
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

    def _run(self, colcon: Colcon, sources: Sources, parts: Mapping[str, CachedBuild]) -> _Built:
        """Build without a look into the cache, with the parts that were built before."""
        limits, install = self.setting.limits, colcon.install
        for name, part in parts.items():
            assert part.install is not None
            standalone_build.lay(name, part.install, install)
            for line in part.build.log.splitlines():
                self.setting.on_output(line)
        # Made before the student's code runs, which could otherwise put a link in its place.
        install.mkdir(exist_ok=True)
        finished = set(parts)
        outcome = self._run_colcon(colcon, finished)
        problem = tidy(
            install,
            colcon.root,
            most_bytes=limits.install_bytes,
            most_files=limits.install_files,
        )
        if problem is None:
            problem = passed_limit(outcome, colcon.wall_s)
        else:
            # Nothing of it is there any more.
            finished.clear()
        failed = sources.folders.keys() - finished
        record, is_certain = self._record(outcome, colcon, sources, failed, problem)
        if finished:
            # Nodes then start without doing it.
            colcon.compile()
        else:
            # colcon writes its own setup files first.
            shutil.rmtree(install, ignore_errors=True)
        part_records = [part.build for part in parts.values()]
        duration_s = record.duration_s + sum(part.duration_s for part in part_records)
        record = replace(
            record,
            tests=tuple(
                own_tests.pytest_record(name, *colcon.test(sources.folders[name]))
                for name in sorted(self.setting.tested & finished)
            ),
            duration_s=round(duration_s, 3),
            log=build_log.ending("".join(part.log for part in part_records) + record.log),
        )
        return _Built(record, is_certain)

    def _run_colcon(self, colcon: Colcon, finished: set[str]) -> Outcome:
        """Build what is not finished yet; a fault of the machine raises."""
        kills = oom_kills()
        check_python = self.setting.sandbox.watched() if self.setting.sandbox else None
        outcome = colcon.build(finished)
        check_machine(
            outcome, colcon, memory_ran_out=kills != oom_kills(), is_second=self.is_second
        )
        if check_python is not None and outcome.status != 0:
            check_python()
        return outcome

    def _record(
        self,
        outcome: Outcome,
        colcon: Colcon,
        sources: Sources,
        failed: set[str],
        problem: str | None,
    ) -> _Built:
        """What came of a build.

        Args:
            problem: Why the build was ended or cannot be used, or None.
        """
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
        timed_out = outcome.ended_by_us == "time"
        culprit, is_certain = None, False
        if not succeeded:
            culprit = find_build_error(log, failed, sources)
            has_reason = culprit is not None or problem is not None
            is_certain = has_reason and not timed_out and not lacking
            culprit = culprit or last_started(log, sources, problem)
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
        return _Built(record, is_certain)

    def _lacking(self, log: str, sources: Sources) -> set[str]:
        """What ROS 2 Jazzy has and is neither handed in nor whole on this machine."""
        ros = self.setting.ros
        not_found = build_log.not_found(log)
        packages = (not_found | build_log.modules_not_found(log)) & PACKAGES
        return (
            (packages - ros.packages - set(sources.folders))
            | missing_here(not_found)
            | set(missing_tools(ros.environment({})["PATH"]))
            | damaged(log, ros, sources.folders)
        )
