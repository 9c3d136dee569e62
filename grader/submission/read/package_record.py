"""What is recorded of each package of a submission: first its files, then what the build made."""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from grader.machine.ros import RosInstallation
from grader.recording.submission import (
    EMPTY,
    Dependency,
    Import,
    PackageRecord,
    SourceError,
    SourceFile,
)
from grader.submission.build.installed import MOST_BYTES, InstallSpace, normalised
from grader.submission.intake.paths import is_within, join, shown
from grader.submission.read.dependencies import is_known
from grader.submission.read.imports import ros_imports
from grader.submission.read.includes import Included, is_built, read_included
from grader.submission.read.outline import outline
from grader.submission.read.package import CMAKE, MOST_DEFINITIONS, SETUP_PY, WORD, Package
from grader.submission.read.rosdistro import PACKAGES, PYTHON_MODULES
from grader.submission.read.setup_py import EntryPoint
from grader.submission.read.targets import Modules, missing_target


@dataclass(frozen=True)
class Surroundings:
    """What a package can find around it: ROS, and the packages that it was handed in with.

    Attributes:
        submitted: Names of the submission's packages.
        providers: Importable module -> packages of which each provides it.
    """

    ros: RosInstallation
    submitted: Collection[str]
    providers: Mapping[str, tuple[str, ...]]

    @classmethod
    def of(cls, packages: Sequence[Package], ros: RosInstallation) -> Surroundings:
        """What is around each of a submission's packages."""
        providers = {name: (name,) for name in ros.python_modules} | PYTHON_MODULES
        for package in packages:
            names = {package.name, *package.modules().top_level}
            providers.update(dict.fromkeys(names, (package.name,)))
        return cls(ros, {package.name for package in packages}, providers)

    def has_package(self, name: str) -> bool:
        """Whether a name is that of a ROS package, installed or not."""
        return name in PACKAGES or name in self.ros.packages or name in self.submitted


def record_packages(
    packages: Sequence[Package], ros: RosInstallation, installed: InstallSpace | None
) -> tuple[PackageRecord, ...]:
    """Record all packages of a submission.

    Args:
        installed: What the build made, or None where nothing was built.
    """
    surroundings = Surroundings.of(packages, ros)
    records = []
    for package in packages:
        record = _record(package, surroundings)
        entry_points, modules = package.setup.entry_points, package.modules()
        if installed is not None:
            built = _installed_entry_points(package, installed)
            if built is not None:
                entry_points, modules = built, package.modules(installed.python)
            programs = {entry.name for entry in entry_points} | {*WORD.findall(record.cmake or "")}
            record = replace(
                _with_installed_files(record, package, installed),
                misplaced_executables=tuple(
                    path
                    for path in installed.outside(package.name)
                    # A program in a wrong folder is this package's if no other could have made it.
                    if len(packages) == 1 or path.rpartition("/")[2] in programs
                ),
            )
        records.append(_with_entry_points(record, entry_points, modules, surroundings.providers))
    return tuple(sorted(records, key=lambda record: record.name))


def _record(package: Package, surroundings: Surroundings) -> PackageRecord:
    """What is known of a package before it is built."""
    manifest = package.manifest
    included = _included(package, surroundings)
    return PackageRecord(
        name=package.name,
        path=shown(package.folder),
        build_type=package.build_type,
        manifest_error=manifest.error,
        dependencies=(*_dependencies(package, surroundings), *manifest.misplaced),
        imports=tuple(package.imports),
        ros_imports=(*_python_ros_imports(package, surroundings.providers), *included.packages),
        own_headers=included.own,
        syntax_errors=_syntax_errors(package),
        newer_syntax=package.newer_syntax,
        description=shown(manifest.description),
        maintainers=tuple(map(shown, manifest.maintainers)),
        licenses=tuple(map(shown, manifest.licenses)),
        groups=manifest.groups,
        cmake=None if package.cmake is None else package.cmake[:MOST_BYTES],
        definitions=tuple(replace(one, file=shown(one.file)) for one in package.definitions),
        sources=_sources(package),
        lint=package.lint,
    )


def _included(package: Package, surroundings: Surroundings) -> Included:
    """The packages and own headers that its C++ includes."""
    return read_included(
        {shown(path): file.includes for path, file in package.code_cpp.items()},
        package.cmake,
        shown(join(package.folder, CMAKE)),
        lambda name: name != package.name and surroundings.has_package(name),
    )


def _dependencies(package: Package, surroundings: Surroundings) -> Iterable[Dependency]:
    installed, submitted = surroundings.ros.packages, surroundings.submitted
    for entry in package.manifest.dependencies:
        known = is_known(entry.name, installed=installed, submitted=submitted)
        yield replace(entry, name=shown(entry.name), known=known)


def _python_ros_imports(package: Package, providers: Mapping[str, tuple[str, ...]]) -> list[Import]:
    """The ROS packages that its Python imports; of those that provide a module, the declared."""
    declared = {entry.name for entry in package.manifest.dependencies}
    return ros_imports(
        package.imports,
        own=package.modules().top_level | {package.name},
        packages={
            module: next((name for name in names if name in declared), names[0])
            for module, names in providers.items()
        },
    )


def _syntax_errors(package: Package) -> tuple[SourceError, ...]:
    """What keeps its files from being read, or from being built at all."""
    newer = {error.file for error in package.newer_syntax}
    trees = (tree for _, tree in sorted(package.trees.items()))
    broken = [tree for tree in trees if isinstance(tree, SourceError) and tree.file not in newer]
    if package.build_type == "ament_python":
        return (*broken, *package.setup.refused)
    if package.cmake is not None and not package.cmake.strip():
        broken.append(SourceError(shown(join(package.folder, CMAKE)), None, EMPTY))
    return tuple(broken)


def _sources(package: Package) -> tuple[SourceFile, ...]:
    """What its code says, Python first."""
    python = (
        outline(tree, shown(path), _module_name(shown(package.module_path(path))))
        for path, tree in package.parsed_code
    )
    cpp = (file for path, file in sorted(package.code_cpp.items()) if is_built(path))
    return (*python, *cpp)


def _module_name(path: str) -> str:
    """The dotted name that a file below the package's Python modules is imported by."""
    return path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def _installed_entry_points(
    package: Package, installed: InstallSpace
) -> tuple[EntryPoint, ...] | None:
    """Its entry points as the build installed them, each with its place in setup.py.

    None where the build installed no Python distribution of it.
    """
    distribution = normalised(package.setup.name or package.name)
    built = installed.entry_points.get(distribution)
    if built is None:
        return None
    unknown_place = (shown(join(package.folder, SETUP_PY)), None)
    places: dict[str, tuple[str, int | None]] = {}
    for declared in package.setup.entry_points:
        places.setdefault(declared.name, (declared.file, declared.line))
    located = []
    for entry in built:
        file, line = places.get(entry.name, unknown_place)
        located.append(replace(entry, file=file, line=line))
    return tuple(located)


def _with_installed_files(
    record: PackageRecord, package: Package, installed: InstallSpace
) -> PackageRecord:
    """Add what the build put into the install space for a package."""
    python = (
        (shown(new), shown(old))
        for new, old in installed.origins.items()
        if is_within(old, package.folder)
    )
    shared = installed.shared.get(package.name, ())
    return replace(
        record,
        files=tuple(sorted(python)),
        generated=installed.definitions.get(package.name, ())[:MOST_DEFINITIONS],
        shared=tuple((shown(new), shown(old)) for new, old in shared),
        registered=package.name in installed.registered,
        executables=installed.executables.get(package.name, ()),
    )


def _with_entry_points(
    record: PackageRecord,
    entry_points: Sequence[EntryPoint],
    modules: Modules,
    providers: Collection[str],
) -> PackageRecord:
    """Add the entry points, and those whose function does not exist."""
    elsewhere = {*providers, *sys.stdlib_module_names}
    missing = []
    for entry in entry_points:
        problem = missing_target(entry, modules, elsewhere=elsewhere)
        if problem is not None:
            missing.append((entry.name, SourceError(entry.file, entry.line, problem)))
    return replace(
        record,
        entry_points=tuple((entry.name, entry.target) for entry in entry_points),
        missing_targets=tuple(missing),
    )
