"""From names of packages to all that has to be built for them, in order.

A package's needs are in its own package.xml, so its sources are fetched first: the index does not
say them, and a list that is kept elsewhere might be another day's.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from itertools import chain
from pathlib import Path

from catkin_pkg.package import Dependency, InvalidPackage, Package, parse_package
from catkin_pkg.package import parse_package_string as parse_text

from grader.errors import GraderFault, UsageError
from grader.machine.ros import DISTRO, RosInstallation
from grader.submission.underlay.distribution import Distribution, Release

# Fetched at the same time: servers answer slowly, and most packages are small.
_AT_ONCE = 8
_CONDITIONS = {"ROS_VERSION": "2", "ROS_DISTRO": DISTRO, "ROS_PYTHON_VERSION": "3"}
_LIMITS: Mapping[str, Callable[[list[int], list[int]], bool]] = {
    "version_lt": lambda is_there, limit: is_there < limit,
    "version_lte": lambda is_there, limit: is_there <= limit,
    "version_eq": lambda is_there, limit: is_there == limit,
    "version_gte": lambda is_there, limit: is_there >= limit,
    "version_gt": lambda is_there, limit: is_there > limit,
}


@dataclass(frozen=True)
class Sources:
    """A package that has to be built.

    Attributes:
        folder: Where its sources are.
        needs: Packages to be built that it needs, for its build or when it runs.
        build_keys: rosdep keys of what it needs of the system to be built.
        run_keys: And of what it only needs when it runs.
    """

    release: Release
    folder: Path
    needs: frozenset[str]
    build_keys: frozenset[str]
    run_keys: frozenset[str]


def resolve(
    names: Iterable[str],
    distribution: Distribution,
    ros: RosInstallation,
    get: Callable[[Release], Path],
) -> list[Sources]:
    """All that has to be built for some packages; what comes first needs nothing that follows.

    Args:
        ros: What it has is not built.
        get: Fetches the sources of a release, and says in which folder they are.

    Raises:
        UsageError: There is no such package, or versions contradict each other.
        GraderFault: Sources cannot be fetched.
    """
    needed: dict[str, Sources] = {}
    unread = [distribution.release(name) for name in sorted(set(names) - ros.packages)]
    with ThreadPoolExecutor(_AT_ONCE) as pool:
        while unread:
            for release, folder in zip(unread, pool.map(get, unread), strict=True):
                needed[release.name] = _read(release, folder, distribution, ros)
            names_of_needs = {name for sources in needed.values() for name in sources.needs}
            missing = sorted(names_of_needs - needed.keys())
            unread = [distribution.releases[name] for name in missing]
    needs = {name: sources.needs for name, sources in needed.items()}
    try:
        return [needed[name] for name in TopologicalSorter(needs).static_order()]
    except CycleError as error:
        circle = " needs ".join(reversed(error.args[1]))
        raise UsageError(f"these packages cannot be built, because {circle}") from error


def closure(names: Collection[str], plan: Collection[Sources]) -> frozenset[str]:
    """Those packages of a plan that some packages need, with themselves."""
    needs = {sources.release.name: sources.needs for sources in plan}
    pending = [name for name in names if name in needs]
    needed = set()
    while pending:
        name = pending.pop()
        if name not in needed:
            needed.add(name)
            pending += needs[name]
    return frozenset(needed)


def _read(
    release: Release, folder: Path, distribution: Distribution, ros: RosInstallation
) -> Sources:
    try:
        package = parse_package(str(folder), warnings=[])
        package.evaluate_conditions(_CONDITIONS)
    except (OSError, InvalidPackage) as error:
        reason = " ".join(str(error).split())
        raise GraderFault(f"{release.source.url}: {release.source.version}: {reason}") from error
    if package.name != release.name:
        raise GraderFault(
            f"{release.source.url}: {release.source.version} holds the package {package.name!r}, "
            f"where the index names {release.name!r}"
        )
    for_build, for_run = _applying(package)
    for dependency in (*for_build, *for_run):
        _check_version(release, dependency, distribution, ros)
    build_names = {dependency.name for dependency in for_build} - ros.packages
    run_names = {dependency.name for dependency in for_run} - ros.packages
    packages = distribution.releases.keys()
    keys = distribution.keys.keys() - packages
    unknown = sorted(build_names - packages - keys)
    if unknown:
        raise GraderFault(
            f"{release.name} {release.version} needs {unknown[0]!r}, which is neither a package "
            "nor a rosdep key of the index"
        )
    return Sources(
        release,
        folder,
        needs=frozenset((build_names | run_names) & packages),
        build_keys=frozenset(build_names & keys),
        run_keys=frozenset(run_names & keys - build_names),
    )


def _applying(package: Package) -> tuple[list[Dependency], list[Dependency]]:
    """What it takes to build a package, and to build or run with it."""
    builds = chain(
        package.build_depends,
        package.buildtool_depends,
        package.build_export_depends,
        package.buildtool_export_depends,
    )
    # Without a condition an entry applies always.
    applies = [one for one in builds if one.evaluated_condition is not False]
    return applies, [one for one in package.exec_depends if one.evaluated_condition is not False]


def _check_version(
    release: Release, needed: Dependency, distribution: Distribution, ros: RosInstallation
) -> None:
    limits = {name: limit for name in _LIMITS if (limit := getattr(needed, name, None))}
    if not limits:
        return
    if needed.name in ros.packages:
        version, where = _installed_version(needed.name, ros), "this ROS installation"
    elif needed.name in distribution.releases:
        version, where = distribution.releases[needed.name].version, "the index"
    else:
        return
    for name, limit in limits.items():
        if version and not _LIMITS[name](_numbers(version), _numbers(limit)):
            raise UsageError(
                f"{release.name} {release.version} needs {needed.name} with {name}={limit!r}, but "
                f"{where} has {version}"
            )


def _installed_version(name: str, ros: RosInstallation) -> str:
    """Version of a package of the installation; nothing where it is not known."""
    for prefix in (*ros.underlays, *ros.prefixes):
        file = prefix / "share" / name / "package.xml"
        if file.is_file():
            return str(parse_text(file.read_bytes(), filename=str(file), warnings=[]).version)
    return ""


def _numbers(version: str) -> list[int]:
    return [int(part) for part in version.split(".") if part.isdigit()]
