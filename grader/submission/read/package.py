"""One package of a submission: what its files say, then what the build made of it."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from grader.ros import RosInstallation
from grader.submission.build.installed import (
    MOST_BYTES,
    InstallSpace,
    hash_of,
    in_folder,
    normalised,
)
from grader.submission.intake.locate import Located
from grader.submission.intake.paths import is_within, join, shown
from grader.submission.read import source
from grader.submission.read.code_facts import Lint, SourceFile
from grader.submission.read.dependencies import is_known
from grader.submission.read.entrypoints import EntryPoint, Setup, read_setup
from grader.submission.read.imports import find_imports, is_code, ros_imports
from grader.submission.read.lint import lint, newer_syntax
from grader.submission.read.manifest import MANIFEST, Manifest, read_manifest
from grader.submission.read.outline import outline
from grader.submission.read.rosdistro import PYTHON_MODULES
from grader.submission.read.targets import Modules, missing_target
from grader.submission.record import Definition, Dependency, Import, PackageRecord, SourceError

CMAKE = "CMakeLists.txt"

_INTERFACES = (".msg", ".srv", ".action")
_MAX_INTERFACE_BYTES = 256 * 1024
_MOST_DEFINITIONS = 200
_MOST_LINES = 1000
"""Of a definition, in which names that the build's log quotes are looked for."""
_WORD = re.compile(r"\w+")
_CONDITIONS = {"ROS_VERSION": "2", "ROS_PYTHON_VERSION": "3"}


@dataclass(frozen=True)
class Package:
    """A package as handed in.

    Attributes:
        cmake: Its CMakeLists.txt, or None where it has none.
        texts: Lines of setup.py and the first ones of the interface files, by path in the
            submission.
        lint: What ruff says of what runs, or None where it was not asked.
        newer_syntax: What only the Python of ROS 2 Jazzy can parse, and not the one here.
    """

    name: str
    folder: str
    manifest: Manifest
    setup: Setup
    cmake: str | None
    texts: Mapping[str, Sequence[str]]
    definitions: tuple[Definition, ...]
    hashes: Mapping[str, str]
    trees: Mapping[str, ast.Module | SourceError]
    lint: Lint | None = None
    newer_syntax: tuple[SourceError, ...] = ()

    @property
    def build_type(self) -> str:
        """As colcon takes it; guessed where package.xml is broken before it says."""
        if self.manifest.build_type is not None:
            return self.manifest.build_type
        has_setup_py = join(self.folder, "setup.py") in self.texts
        return "ament_python" if has_setup_py else "ament_cmake"

    @property
    def module_root(self) -> str:
        """Folder in the submission that holds the package's Python modules."""
        below = self.setup.package_dir
        return self.folder if below == "." else join(self.folder, below)

    @property
    def named(self) -> set[str]:
        """Names of packages that its files may need, and of much else."""
        found = {dependency.name for dependency in self.manifest.dependencies}
        found |= {item.module for item in _imports(self)}
        return found | set(_WORD.findall(self.cmake or ""))

    def code(self) -> dict[str, ast.Module | SourceError]:
        """Trees of what runs: no tests, launch files, setup.py."""
        return {p: t for p, t in self.trees.items() if is_code(_below(p, self.folder))}

    @property
    def unreadable(self) -> list[SourceError]:
        """Files that the Python here cannot parse, sorted."""
        return [tree for _, tree in sorted(self.trees.items()) if isinstance(tree, SourceError)]

    def modules(self, installed: Collection[str] | None = None) -> Modules:
        """The package's Python modules."""
        root = self.module_root
        trees = {
            _below(path, root): tree if isinstance(tree, ast.Module) else None
            for path, tree in self.code().items()
            if is_within(path, root) and path.endswith(".py")
        }
        return Modules(trees, installed)


def read_package(
    located: Located,
    folder: str,
    ros: RosInstallation,
    allowance: source.Allowance | None = None,
) -> Package:
    """Read a package from the private copy of its submission."""
    allowance = allowance or source.Allowance()
    manifest = read_manifest(
        _bytes(located, join(folder, MANIFEST)) or b"",
        shown(join(folder, MANIFEST)),
        {**_CONDITIONS, "ROS_DISTRO": ros.distro},
    )
    setup_py = _bytes(located, join(folder, "setup.py"))
    setup_cfg = _bytes(located, join(folder, "setup.cfg"))
    setup = read_setup(setup_py, setup_cfg, shown(folder), allowance)
    cmake = _bytes(located, join(folder, CMAKE))
    hashes: dict[str, str] = {}
    trees: dict[str, ast.Module | SourceError] = {}
    texts = {join(folder, "setup.py"): _lines(setup_py)} if setup_py is not None else {}
    interfaces = 0
    for file in located.files:
        if not is_within(file.path, folder):
            continue
        if file.path.endswith(_INTERFACES) and file.size <= _MAX_INTERFACE_BYTES:
            interfaces += 1
            if interfaces <= _MOST_DEFINITIONS:
                texts[file.path] = _lines(_bytes(located, file.path) or b"")[:_MOST_LINES]
        suffixed = file.path.endswith(".py")
        if not suffixed and "." in file.path.rpartition("/")[2]:
            continue
        data = _bytes(located, file.path)
        if data is not None and (suffixed or source.is_python_script(data)):
            hashes[file.path] = hash_of(data)
            trees[file.path] = source.parse(data, shown(file.path), allowance)
    folder_name = located.id if folder == "." else folder.rpartition("/")[2]
    package = Package(
        name=manifest.name or setup.name or shown(folder_name),
        folder=folder,
        manifest=manifest,
        setup=setup,
        cmake=None if cmake is None else cmake.decode("utf-8", "replace"),
        texts=texts,
        definitions=tuple(_definitions(located, folder)),
        hashes=hashes,
        trees=trees,
    )
    broken = [path for path, tree in trees.items() if isinstance(tree, SourceError)]
    return replace(
        package,
        lint=lint(located.root, package.code()),
        newer_syntax=newer_syntax(located.root, broken),
    )


def record_packages(
    packages: Sequence[Package], ros: RosInstallation, installed: InstallSpace | None
) -> tuple[PackageRecord, ...]:
    """Record all packages of a submission.

    Args:
        installed: What the build made, or None where nothing was built.
    """
    providers = _providers(packages, ros)
    records = [_record(package, packages, providers, ros, installed) for package in packages]
    return tuple(sorted(records, key=lambda record: record.name))


def _record(
    package: Package,
    packages: Sequence[Package],
    providers: Mapping[str, tuple[str, ...]],
    ros: RosInstallation,
    installed: InstallSpace | None,
) -> PackageRecord:
    submitted = {other.name for other in packages}
    declared = {dependency.name for dependency in package.manifest.dependencies}
    imports = _imports(package)
    newer = {error.file for error in package.newer_syntax}
    record = PackageRecord(
        name=package.name,
        path=shown(package.folder),
        build_type=package.build_type,
        manifest_error=package.manifest.error,
        dependencies=(
            *(_told(dependency, ros, submitted) for dependency in package.manifest.dependencies),
            *package.manifest.misplaced,
        ),
        imports=tuple(imports),
        ros_imports=tuple(
            ros_imports(
                imports,
                own=package.modules().folders | {package.name},
                packages={
                    module: next((name for name in names if name in declared), names[0])
                    for module, names in providers.items()
                },
            )
        ),
        syntax_errors=tuple(error for error in package.unreadable if error.file not in newer),
        newer_syntax=package.newer_syntax,
        groups=package.manifest.groups,
        cmake=None if package.cmake is None else package.cmake[:MOST_BYTES],
        definitions=package.definitions,
        sources=tuple(_sources(package)),
        lint=package.lint,
    )
    return _with_executables(record, package, set(providers), installed, alone=len(packages) == 1)


def _with_executables(
    record: PackageRecord,
    package: Package,
    elsewhere: set[str],
    installed: InstallSpace | None,
    *,
    alone: bool,
) -> PackageRecord:
    entries = list(package.setup.entry_points)
    modules = package.modules()
    files: dict[str, str] = {}
    executables: tuple[str, ...] = ()
    generated: tuple[Definition, ...] = ()
    registered = True
    misplaced: list[str] = []
    if installed is not None:
        files = {shown(i): shown(p) for i, p in in_folder(installed.origins, package.folder)}
        generated = installed.definitions.get(package.name, ())
        registered = package.name in installed.registered
        executables = installed.executables.get(package.name, ())
        distribution = normalised(package.setup.name or package.name)
        built = installed.entry_points.get(distribution)
        if built is not None:
            entries = [_at_declaration(entry, package) for entry in built]
            modules = package.modules(installed.python)
        names = {entry.name for entry in entries}
        misplaced = [name for name in installed.in_bin if alone or name in names]
    elsewhere = elsewhere | sys.stdlib_module_names
    missing = [(e.name, missing_target(e, modules, elsewhere=elsewhere)) for e in entries]
    return replace(
        record,
        entry_points=tuple((entry.name, entry.target) for entry in entries),
        executables=executables,
        misplaced_executables=tuple(misplaced),
        missing_targets=tuple((name, error) for name, error in missing if error is not None),
        files=tuple(sorted(files.items())),
        generated=generated[:_MOST_DEFINITIONS],
        registered=registered,
    )


def _at_declaration(entry: EntryPoint, package: Package) -> EntryPoint:
    """Give an installed entry point the place where the student wrote it."""
    for declared in package.setup.entry_points:
        if declared.name == entry.name:
            return replace(entry, file=declared.file, line=declared.line)
    return replace(entry, file=shown(join(package.folder, "setup.py")))


def _imports(package: Package) -> list[Import]:
    found: list[Import] = []
    for path, tree in sorted(package.code().items()):
        if isinstance(tree, ast.Module):
            found += find_imports(tree, shown(path))
    return found


def _sources(package: Package) -> Iterator[SourceFile]:
    for path, tree in sorted(package.code().items()):
        if isinstance(tree, ast.Module):
            yield outline(tree, shown(path), _module(shown(_below(path, package.module_root))))


def _module(path: str) -> str:
    """The dotted name that a file below the package's Python modules is imported by."""
    return path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def _providers(packages: Sequence[Package], ros: RosInstallation) -> dict[str, tuple[str, ...]]:
    """Importable module -> packages of which each provides it."""
    providers: dict[str, tuple[str, ...]] = {name: (name,) for name in ros.python_modules}
    providers.update(PYTHON_MODULES)
    for package in packages:
        providers[package.name] = (package.name,)
        providers.update({module: (package.name,) for module in package.modules().folders})
    return providers


def _told(dependency: Dependency, ros: RosInstallation, submitted: set[str]) -> Dependency:
    known = is_known(dependency.name, installed=ros.packages, submitted=submitted)
    return replace(dependency, name=shown(dependency.name), known=known)


def _definitions(located: Located, folder: str) -> Iterator[Definition]:
    """Files of a package that are definitions of interfaces, or seem to be meant as such."""
    found = 0
    for file in located.files:
        *folders, name = file.path.split("/")
        suffix = "." + name.rpartition(".")[2]
        meant = suffix.lower() in _INTERFACES or (
            folders[-1:] and f".{folders[-1].lower()}" in _INTERFACES
        )
        if not meant or not is_within(file.path, folder) or file.size > MOST_BYTES:
            continue
        found += 1
        if found > _MOST_DEFINITIONS:
            return
        data = _bytes(located, file.path) or b""
        yield Definition(shown(file.path), data.decode("utf-8", "replace"))


def _below(path: str, folder: str) -> str:
    return path if folder == "." else path[len(folder) + 1 :]


def _lines(data: bytes) -> list[str]:
    return data.decode("utf-8", "replace").splitlines()


def _bytes(located: Located, path: str) -> bytes | None:
    """Read a file of the private copy; its links lead to nothing outside of it."""
    try:
        return (located.root / path).read_bytes()
    except OSError:
        return None
