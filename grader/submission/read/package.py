"""One package of a submission as it was handed in: what its files say before any build."""

from __future__ import annotations

import ast
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from grader.machine.ros import RosInstallation
from grader.recording.submission import Definition, Import, Lint, SourceError, SourceFile
from grader.submission.build.installed import MOST_BYTES, hash_of
from grader.submission.intake.listing import SubmissionFile
from grader.submission.intake.locate import Located
from grader.submission.intake.paths import is_within, join, shown
from grader.submission.read import source
from grader.submission.read.cmake import read_commands
from grader.submission.read.imports import find_imports, is_code
from grader.submission.read.lint import lint, newer_syntax
from grader.submission.read.manifest import MANIFEST, Manifest, read_manifest
from grader.submission.read.rosdistro import PYTHON_MODULES
from grader.submission.read.setup_py import Setup, read_setup
from grader.submission.read.targets import Modules

SETUP_PY, CMAKE = "setup.py", "CMakeLists.txt"
MOST_DEFINITIONS = 200
"""Definitions of interfaces that are kept of one package."""
WORD = re.compile(r"\w+")
_INTERFACES = (".msg", ".srv", ".action")
_FOR_BUILD = ("depend", "build_depend", "buildtool_depend", "build_export_depend")
_CONDITIONS = {"ROS_VERSION": "2", "ROS_PYTHON_VERSION": "3"}


@dataclass(frozen=True)
class Package:
    """A package as handed in; :mod:`~grader.submission.read.package_record` makes its record.

    Attributes:
        folder: Its path in the submission, ``.`` where the submission is the package.
        cmake: Text of its CMakeLists.txt, or None.
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
    def required_packages(self) -> set[str]:
        """Packages without which it is not built, or its Python does not run.

        Names of other Python modules are among them, too.
        """
        # The last package that is known for a module is the one that installs it.
        required = {PYTHON_MODULES.get(name, (name,))[-1] for name in self._imported_modules}
        if self.cmake is not None:
            dependencies = self.manifest.dependencies
            required |= {entry.name for entry in dependencies if entry.kind in _FOR_BUILD}
            required |= {
                command.arguments[0]
                for command in read_commands(self.cmake)
                if command.name == "find_package" and command.arguments
            }
        return required

    @property
    def possible_packages(self) -> set[str]:
        """Every name in its files that a package it needs could have; most are no packages."""
        declared = {entry.name for entry in self.manifest.dependencies}
        return declared | self._imported_modules | set(WORD.findall(self.cmake or ""))

    @property
    def texts(self) -> dict[str, Sequence[str]]:
        """Lines of the definitions, by path: what messages of a build quote."""
        return {entry.file: entry.text.splitlines() for entry in self.definitions}

    @property
    def code(self) -> dict[str, ast.Module | SourceError]:
        """Trees of what runs, by path: no tests, launch files, setup.py."""
        return {
            path: tree
            for path, tree in sorted(self.trees.items())
            if is_code(_inside(path, self.folder))
        }

    @property
    def parsed_code(self) -> Iterator[tuple[str, ast.Module]]:
        """The same, without the files that are no Python."""
        return ((path, tree) for path, tree in self.code.items() if isinstance(tree, ast.Module))

    @property
    def imports(self) -> list[Import]:
        """Everything that its code imports."""
        return [item for path, tree in self.parsed_code for item in find_imports(tree, shown(path))]

    @property
    def _imported_modules(self) -> set[str]:
        return {item.module for item in self.imports}

    def module_path(self, path: str) -> str:
        """Path of a file below the folder of the Python modules, which may be ``src``."""
        return _inside(path, self.folder).removeprefix("src/")

    def modules(self, installed: Collection[str] | None = None) -> Modules:
        """The package's Python modules."""
        trees = {
            self.module_path(path): tree if isinstance(tree, ast.Module) else None
            for path, tree in self.code.items()
            if path.endswith(".py")
        }
        return Modules(trees, installed)


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
    python = _python_files(located, files)
    trees = {path: source.parse(data, shown(path), allowance) for path, data in python.items()}
    code = [path for path in trees if is_code(_inside(path, folder))]
    broken = [path for path, tree in trees.items() if isinstance(tree, SourceError)]
    folder_name = located.id if folder == "." else folder.rpartition("/")[2]
    return Package(
        name=manifest.name or setup.name or shown(folder_name),
        folder=folder,
        manifest=manifest,
        setup=setup,
        cmake=None if cmake is None else _text(cmake),
        has_setup_py=setup_py is not None,
        definitions=_definitions(located, files),
        hashes={path: hash_of(data) for path, data in python.items()},
        trees=trees,
        lint=lint(located.root, code),
        newer_syntax=newer_syntax(located.root, broken),
        code_cpp={
            _inside(path, folder): outline
            for path, outline in (outlines or {}).items()
            if is_within(path, folder)
        },
    )


def _python_files(located: Located, files: Sequence[SubmissionFile]) -> dict[str, bytes]:
    """Contents of modules and of scripts: a script may have no suffix."""
    contents: dict[str, bytes] = {}
    for file in files:
        name = file.path.rpartition("/")[2]
        is_module = name.endswith(".py")
        if "." in name and not is_module:
            continue
        data = _bytes(located, file.path)
        if data is not None and (is_module or source.is_python_script(data)):
            contents[file.path] = data
    return contents


def _definitions(located: Located, files: Sequence[SubmissionFile]) -> tuple[Definition, ...]:
    paths = [file.path for file in files if _is_definition(file)][:MOST_DEFINITIONS]
    return tuple(Definition(path, _text(_bytes(located, path) or b"")) for path in paths)


def _is_definition(file: SubmissionFile) -> bool:
    """Whether a file is the definition of an interface, or seems to be meant as one.

    By its suffix, or by its folder: a student may have called it ``msg/Pose.txt``.
    """
    *folders, name = file.path.split("/")
    kinds = {f".{name.rpartition('.')[2]}", *(f".{folder}" for folder in folders[-1:])}
    return file.size <= MOST_BYTES and any(kind.lower() in _INTERFACES for kind in kinds)


def _inside(path: str, folder: str) -> str:
    """A path in the submission, from the folder of a package."""
    return path if folder == "." else path.removeprefix(f"{folder}/")


def _text(data: bytes) -> str:
    return data.decode("utf-8", "replace")


def _bytes(located: Located, path: str) -> bytes | None:
    """Read a file of the private copy; its links lead to nothing outside of it."""
    try:
        return (located.root / path).read_bytes()
    except OSError:
        return None
