"""rosgrade's own interface packages: built like a student's, cached, used as underlays.

The wheels of ROS 2 lack ``example_interfaces``, which tutorials use all the time. And an assignment
in whose lesson the student writes an interface package brings its own copy, because the probe never
imports what a student wrote.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

from grader.errors import GraderFault
from grader.resources import carried_interfaces
from grader.ros import RosInstallation
from grader.submission.build.build import Builder, once_more
from grader.submission.build.build_cache import BuildCache, CachedBuild
from grader.submission.build.build_error_location import Sources
from grader.submission.build.colcon import BuildLimits
from grader.submission.build.toolchain import check_toolchain, missing_tools
from grader.submission.intake.locate import opened

CARRIED = carried_interfaces()
"""One folder for each package that the wheels lack."""

# Thirty interfaces take 95 s of CPU.
_LIMITS = BuildLimits(other_s=1200.0)


def install_prefix(
    packages: Path,
    ros: RosInstallation,
    cache: BuildCache,
    on_progress: Callable[[str], None] = lambda _: None,
) -> Path:
    """The install space (merged layout) of interface packages of rosgrade, built if needed."""
    check_toolchain(ros.environment({})["PATH"])

    def attempt(is_second: bool) -> CachedBuild:
        builder = Builder(
            ros=ros,
            cache=cache,
            limits=_LIMITS,
            on_progress=lambda what: on_progress(f"{what} (once on this machine)"),
            is_second=is_second,
        )
        with opened(packages) as located:
            folders = {
                packages.name if folder == "." else folder.rpartition("/")[2]: folder
                for folder in located.packages
            }
            sources = Sources({file.path for file in located.files}, folders)
            return builder.build(located, sources, only_python=False, is_standalone=True)

    built = once_more(attempt)
    if built.install is None or not built.build.succeeded:
        reason = built.build.culprit or built.build.log[-2000:]
        raise GraderFault(f"the interface packages in {packages} could not be built: {reason}")
    return built.install


def completed(
    ros: RosInstallation,
    named: Iterable[str],
    cache: BuildCache,
    on_progress: Callable[[str], None] = lambda _: None,
) -> RosInstallation:
    """Add rosgrade's packages among some names to an installation that lacks them."""
    if missing_tools(ros.environment({})["PATH"]):
        # The build of what needs them fails, and the rest of the submission is graded.
        return ros
    underlays = tuple(
        install_prefix(CARRIED / name, ros, cache, on_progress)
        for name in sorted(set(named) - ros.packages)
        if (CARRIED / name).is_dir()
    )
    return replace(ros, underlays=(*ros.underlays, *underlays)) if underlays else ros
