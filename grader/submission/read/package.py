"""One package of a submission: what its files say, then what the build made of it."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from grader.machine.ros import RosInstallation
from grader.recording.submission import (
    EMPTY,
    Definition,
    Import,
    Lint,
    PackageRecord,
    SourceError,
    SourceFile,
)
from grader.submission.build.installed import (
    MOST_BYTES,
    InstallSpace,
    hash_of,
    normalised,
)
from grader.submission.intake.listing import SubmissionFile
from grader.submission.intake.locate import Located
from grader.submission.intake.paths import is_within, join, shown
from grader.submission.read import source
from grader.submission.read.cmake import read_commands
from grader.submission.read.dependencies import is_known
from grader.submission.read.imports import find_imports, is_code, ros_imports
from grader.submission.read.includes import is_built, read_included
from grader.submission.read.lint import lint, newer_syntax
from grader.submission.read.manifest import MANIFEST, Manifest, read_manifest
from grader.submission.read.outline import outline
from grader.submission.read.rosdistro import PACKAGES, PYTHON_MODULES
from grader.submission.read.setup_py import EntryPoint, Setup, read_setup
from grader.submission.read.targets import Modules, missing_target

SETUP_PY, CMAKE = "setup.py", "CMakeLists.txt"
_INTERFACES = (".msg", ".srv", ".action")
_MOST_DEFINITIONS = 200
_WORD = re.compile(r"\w+")
_FOR_BUILD = ("depend", "build_depend", "buildtool_depend", "build_export_depend")
_CONDITIONS = {"ROS_VERSION": "2", "ROS_PYTHON_VERSION": "3"}


@dataclass(frozen=True)
class Package:
    """A package as handed in; see :class:`PackageRecord` for what it shares with that.

    Attributes:
        hashes: Path of each Python file in the submission -> hash of its content.
        trees: Path of each Python file -> its syntax tree, or why there is none.
        code_cpp: Path of each file of C and C++, from the folder of the package -> what it says.
    """

    name: str
    folder: str
    manifest: Manifest
    setup: Setup
    cmake: str | None
    has_setup_py: bool
    definitions: tuple[Definition, ...]
    hashes: Mapping[str, str]
    trees: Mapping[str, ast.Module | SourceError]
    lint: Lint | None = None
    newer_syntax: tuple[SourceError, ...] = ()
    code_cpp: Mapping[str, SourceFile] = field(default_factory=dict)

    @property
    def build_type(self) -> str:
        """As colcon takes it; guessed where package.xml is broken before it says."""
        guessed = "ament_python" if self.has_setup_py else "ament_cmake"
        return self.manifest.build_type or guessed

    @property
    def named(self) -> set[str]:
        """Names of packages that its files may need, and of much else."""
        found = {dependency.name for dependency in self.manifest.dependencies}
        found |= {item.module for item in self.imports}
        return found | set(_WORD.findall(self.cmake or ""))

    @property
    def used(self) -> set[str]:
        """Names of packages without which it is not built, or its Python does not run."""
        modules = (item.module for item in self.imports)
        found = {PYTHON_MODULES.get(name, (name,))[-1] for name in modules}
        if self.cmake is not None:
            named = self.manifest.dependencies
            found |= {one.name for one in named if one.kind in _FOR_BUILD}
            calls = (one for one in read_commands(self.cmake) if one.name == "find_package")
            found |= {one.arguments[0] for one in calls if one.arguments}
        return found

    @property
    def texts(self) -> dict[str, Sequence[str]]:
        """Lines of the definitions, by path: what messages of a build quote."""
        return {one.file: one.text.splitlines() for one in self.definitions}

    @property
    def code(self) -> dict[str, ast.Module | SourceError]:
        """Trees of what runs: no tests, launch files, setup.py."""
        return {path: tree for path, tree in sorted(self.trees.items()) if is_code(self._in(path))}

    @property
    def imports(self) -> list[Import]:
        """Everything that its code imports."""
        return [item for path, tree in self._parsed() for item in find_imports(tree, shown(path))]

    def _parsed(self) -> Iterator[tuple[str, ast.Module]]:
        return ((path, tree) for path, tree in self.code.items() if isinstance(tree, ast.Module))

    def _in(self, path: str) -> str:
        return path if self.folder == "." else path[len(self.folder) + 1 :]

    @property
    def _refused(self) -> tuple[SourceError, ...]:
        """What is wrong with the file that builds it, as far as that is seen without a build."""
        if self.build_type == "ament_python":
            return self.setup.refused
        empty = self.cmake is not None and not self.cmake.strip()
        return (SourceError(shown(join(self.folder, CMAKE)), None, EMPTY),) if empty else ()

    def _module_path(self, path: str) -> str:
        """Path of a file below the folder of the Python modules, which may be ``src``."""
        return self._in(path).removeprefix("src/")

    def modules(self, installed: Collection[str] | None = None) -> Modules:
        """The package's Python modules."""
        trees = {
            self._module_path(path): tree if isinstance(tree, ast.Module) else None
            for path, tree in self.code.items()
            if path.endswith(".py")
        }
        return Modules(trees, installed)

    def record(
        self,
        packages: Sequence[Package],
        providers: Mapping[str, tuple[str, ...]],
        ros: RosInstallation,
    ) -> PackageRecord:
        """What is known of it, one of the submission's packages, before it is built.

        Args:
            providers: Importable module -> packages of which each provides it.
        """
        submitted = {other.name for other in packages}
        declared = {dependency.name for dependency in self.manifest.dependencies}
        imports = self.imports
        newer = {error.file for error in self.newer_syntax}
        errors = (tree for _, tree in sorted(self.trees.items()) if isinstance(tree, SourceError))
        included = read_included(
            {shown(path): one.includes for path, one in self.code_cpp.items()},
            self.cmake,
            shown(join(self.folder, CMAKE)),
            lambda name: name != self.name and name in {*PACKAGES, *ros.packages, *submitted},
        )
        dependencies = (
            replace(
                one,
                name=shown(one.name),
                known=is_known(one.name, installed=ros.packages, submitted=submitted),
            )
            for one in self.manifest.dependencies
        )
        return PackageRecord(
            name=self.name,
            path=shown(self.folder),
            build_type=self.build_type,
            manifest_error=self.manifest.error,
            dependencies=(*dependencies, *self.manifest.misplaced),
            imports=tuple(imports),
            ros_imports=(
                *ros_imports(
                    imports,
                    own=self.modules().top_level | {self.name},
                    packages={
                        module: next((name for name in names if name in declared), names[0])
                        for module, names in providers.items()
                    },
                ),
                *included.packages,
            ),
            own_headers=included.own,
            syntax_errors=(
                *(error for error in errors if error.file not in newer),
                *self._refused,
            ),
            newer_syntax=self.newer_syntax,
            description=shown(self.manifest.description),
            maintainers=tuple(map(shown, self.manifest.maintainers)),
            licenses=tuple(map(shown, self.manifest.licenses)),
            groups=self.manifest.groups,
            cmake=None if self.cmake is None else self.cmake[:MOST_BYTES],
            definitions=tuple(replace(one, file=shown(one.file)) for one in self.definitions),
            sources=(
                *(
                    outline(tree, shown(path), _module(shown(self._module_path(path))))
                    for path, tree in self._parsed()
                ),
                *(one for path, one in sorted(self.code_cpp.items()) if is_built(path)),
            ),
            lint=self.lint,
        )


def read_package(
    located: Located,
    folder: str,
    ros: RosInstallation,
    allowance: source.Allowance | None = None,
    outlines: Mapping[str, SourceFile] | None = None,
) -> Package:
    """Read a package from the private copy of its submission.

    Args:
        outlines: What its C++ says, by paths in the submission.
    """

    def content(name: str) -> bytes | None:
        return _bytes(located, join(folder, name))

    allowance = allowance or source.Allowance()
    manifest = read_manifest(
        content(MANIFEST) or b"",
        shown(join(folder, MANIFEST)),
        {**_CONDITIONS, "ROS_DISTRO": ros.distro},
    )
    setup_py, cmake = content(SETUP_PY), content(CMAKE)
    setup = read_setup(setup_py, shown(folder), allowance)
    files = [file for file in located.files if is_within(file.path, folder)]
    hashes: dict[str, str] = {}
    trees: dict[str, ast.Module | SourceError] = {}
    for file in files:
        suffixed = file.path.endswith(".py")
        if not suffixed and "." in file.path.rpartition("/")[2]:
            continue
        data = _bytes(located, file.path)
        if data is not None and (suffixed or source.is_python_script(data)):
            hashes[file.path] = hash_of(data)
            trees[file.path] = source.parse(data, shown(file.path), allowance)
    code_cpp = {
        path if folder == "." else path[len(folder) + 1 :]: one
        for path, one in (outlines or {}).items()
        if is_within(path, folder)
    }
    folder_name = located.id if folder == "." else folder.rpartition("/")[2]
    package = Package(
        name=manifest.name or setup.name or shown(folder_name),
        folder=folder,
        manifest=manifest,
        setup=setup,
        cmake=None if cmake is None else _text(cmake),
        has_setup_py=setup_py is not None,
        definitions=tuple(
            Definition(file.path, _text(_bytes(located, file.path) or b""))
            for file in [one for one in files if _is_definition(one)][:_MOST_DEFINITIONS]
        ),
        hashes=hashes,
        trees=trees,
        code_cpp=code_cpp,
    )
    broken = [path for path, tree in trees.items() if isinstance(tree, SourceError)]
    return replace(
        package,
        lint=lint(located.root, package.code),
        newer_syntax=newer_syntax(located.root, broken),
    )


def record_packages(
    packages: Sequence[Package], ros: RosInstallation, installed: InstallSpace | None
) -> tuple[PackageRecord, ...]:
    """Record all packages of a submission.

    Args:
        installed: What the build made, or None where nothing was built.
    """
    providers: dict[str, tuple[str, ...]] = {name: (name,) for name in ros.python_modules}
    providers.update(PYTHON_MODULES)
    for package in packages:
        providers[package.name] = (package.name,)
        providers.update({module: (package.name,) for module in package.modules().top_level})
    elsewhere = {*providers, *sys.stdlib_module_names}
    alone = len(packages) == 1
    records = [
        _with_executables(
            package.record(packages, providers, ros), package, elsewhere, installed, alone=alone
        )
        for package in packages
    ]
    return tuple(sorted(records, key=lambda record: record.name))


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
    if installed is not None:
        files = (
            (shown(new), shown(old))
            for new, old in installed.origins.items()
            if is_within(old, package.folder)
        )
        distribution = normalised(package.setup.name or package.name)
        built = installed.entry_points.get(distribution)
        if built is not None:
            entries = [_at_declaration(entry, package) for entry in built]
            modules = package.modules(installed.python)
        names = {entry.name for entry in entries} | {*_WORD.findall(record.cmake or "")}
        record = replace(
            record,
            files=tuple(sorted(files)),
            generated=installed.definitions.get(package.name, ())[:_MOST_DEFINITIONS],
            shared=tuple(
                (shown(new), shown(old)) for new, old in installed.shared.get(package.name, ())
            ),
            registered=package.name in installed.registered,
            executables=installed.executables.get(package.name, ()),
            misplaced_executables=tuple(
                path
                for path in installed.outside(package.name)
                if alone or path.rpartition("/")[2] in names
            ),
        )
    missing = [(entry, missing_target(entry, modules, elsewhere=elsewhere)) for entry in entries]
    return replace(
        record,
        entry_points=tuple((entry.name, entry.target) for entry in entries),
        missing_targets=tuple(
            (entry.name, SourceError(entry.file, entry.line, problem))
            for entry, problem in missing
            if problem is not None
        ),
    )


def _at_declaration(entry: EntryPoint, package: Package) -> EntryPoint:
    """Give an installed entry point the place where the student wrote it."""
    for declared in package.setup.entry_points:
        if declared.name == entry.name:
            return replace(entry, file=declared.file, line=declared.line)
    return replace(entry, file=shown(join(package.folder, SETUP_PY)))


def _module(path: str) -> str:
    """The dotted name that a file below the package's Python modules is imported by."""
    return path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def _is_definition(file: SubmissionFile) -> bool:
    """Whether a file is the definition of an interface, or seems to be meant as one."""
    *folders, name = file.path.split("/")
    kinds = {f".{name.rpartition('.')[2]}", *(f".{folder}" for folder in folders[-1:])}
    meant = any(kind.lower() in _INTERFACES for kind in kinds)
    return meant and file.size <= MOST_BYTES


def _text(data: bytes) -> str:
    return data.decode("utf-8", "replace")


def _bytes(located: Located, path: str) -> bytes | None:
    """Read a file of the private copy; its links lead to nothing outside of it."""
    try:
        return (located.root / path).read_bytes()
    except OSError:
        return None
