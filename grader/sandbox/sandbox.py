"""The sandbox of this machine: whether there is one, and how things are started in it."""

from __future__ import annotations

import hashlib
import os
import re
import sys
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import grader
import sim
from grader.errors import GraderFault
from grader.machine.resources import kept_underlays
from grader.machine.ros import RosInstallation
from grader.sandbox import bubblewrap
from grader.sandbox.bubblewrap import Bind
from grader.sandbox.cpu_time import OrphanCpu
from grader.sandbox.limits import BUILD, SandboxLimits, size_words
from grader.sandbox.memory import hidden_bytes, memory_bytes
from grader.sandbox.namespaces import MOUNT_POINTS
from grader.sandbox.python_tree import discard, is_whole, student_prefix, trees_folder
from grader.sandbox.seccomp import student_filter
from grader.sandbox.usage import Usage, folder_usage, open_files

LAYERS = ("userns", "netns", "seccomp", "rlimits", "watchdog")

TREES = Path("/run/python")
"""Path of the students' Python environments in a cell."""
ENVIRONMENT = Path("/run/environment")
"""Path of rosgrade's own Python environment in a cell."""
CODE = (Path(grader.__file__).resolve().parent, Path(sim.__file__).resolve().parent)

_CELL_UID, _BUILD_UID = 2000, 1000
# The last ones fail to start, so they are never all there.
_NEARLY_ALL = 0.95
_OPEN_FILES = 4096
"""Of all processes of a build: a compiler and all that drives it have some each."""
_DATA = CODE[0] / "_data"
_UNDERLAYS = Path("/run/underlays")
_USR = Path("/usr")
_SITE = "lib/python3*/site-packages"


@dataclass
class Sandbox:
    """Starts processes in a sandbox; students' Python environments are kept in rosgrade's cache."""

    cache: Path
    libraries: tuple[str, ...] = ()
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False)
    _tree: Path | None = field(default=None, repr=False)
    _others: dict[tuple[str, ...], Sandbox] = field(default_factory=dict, repr=False)

    @property
    def description(self) -> str:
        """The sandbox in words, for the report."""
        return f"bwrap ({', '.join(LAYERS)})"

    def allowing(self, libraries: tuple[str, ...]) -> Sandbox:
        """The same sandbox for an assignment that allows these libraries."""
        if libraries == self.libraries:
            return self
        with self._lock:
            return self._others.setdefault(libraries, Sandbox(self.cache, libraries))

    def filter_file(self, program: bytes) -> Path:
        """A file with a filter of system calls; read at every use, as caches may be emptied."""
        file = self.cache / "sandbox" / f"{hashlib.sha256(program).hexdigest()[:32]}.bpf"
        if not file.is_file() or file.read_bytes() != program:
            file.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile(dir=file.parent, delete=False) as unfinished:
                unfinished.write(program)
            Path(unfinished.name).replace(file)
        return file

    @property
    def python_tree(self) -> Path:
        """The Python environment of students."""
        with self._lock:
            if self._tree is None or not self._tree.is_dir():
                self._tree = student_prefix(self.cache, self.libraries)
            return self._tree

    @property
    def cached(self) -> tuple[Path, ...]:
        """Folders of the cache that a cell sees."""
        own = (self.python_tree,) if _in_environment() else ()
        return (trees_folder(self.cache), *own, *(bind.source for bind in self.underlays()))

    def underlays(self) -> list[Bind]:
        """The underlays that are kept on this machine, as cells see them."""
        # A sandbox runs as another user, where rosgrade runs as root; built with a umask such as
        # 077, an underlay is copied for it.
        return [
            Bind(path, _UNDERLAYS / path.parent.name)
            for path in kept_underlays(self.cache)
            if path.stat().st_mode & 0o555 == 0o555
        ]

    def watched(self) -> Callable[[], None]:
        """A function that raises :class:`GraderFault` if the students' Python was damaged."""
        tree = self.python_tree if _in_environment() else None

        def check() -> None:
            if tree is None:
                return
            with self._lock:
                if self._tree is tree and is_whole(tree):
                    return
                if self._tree is tree:
                    discard(tree)
                    self._tree = None
            raise GraderFault(
                f"files of the sandbox's Python were deleted in {tree.parent}, perhaps by a "
                "clean-up. Grade again: rosgrade makes them again"
            )

        return check

    def student_view(self, ros: RosInstallation, trees: Path | None = None) -> list[Bind]:
        """What untrusted code sees of Python and ROS."""
        own = Path(sys.prefix)
        binds = [Bind.same(path) for path in _python_and_ros(ros) if path != own]
        if _in_environment():
            tree = self.python_tree
            binds.append(Bind(trees / tree.name if trees else tree, own))
        return binds

    def server_command(
        self,
        command: Sequence[str],
        ros: RosInstallation,
        cells: Path,
        environment: Mapping[str, str],
        shown: Sequence[Bind] = (),
    ) -> list[str]:
        """The command line of a prefork server whose cells can go into namespaces of their own."""
        # Students' interpreters start there as well, so Python's place shows their environment;
        # rosgrade's processes find their own beside it.
        binds = self.student_view(ros)
        if _in_environment():
            binds.append(Bind(Path(sys.prefix), ENVIRONMENT))
            environment = _beside(environment)
        binds += [Bind.same(path) for path in CODE if not _is_within(path, binds)]
        binds += [*shown, Bind(trees_folder(self.cache), TREES), Bind.same(cells, writable=True)]
        arguments = [*bubblewrap.namespaces(_CELL_UID), *bubblewrap.system(), "--tmpfs", "/tmp"]
        for place in MOUNT_POINTS:
            arguments += ["--dir", str(place)]
        last = ["--tmpfs", str(_seen_beside(_DATA))] if _DATA.is_dir() else []
        last += ["--remount-ro", "/", "--chdir", "/", *bubblewrap.variables(environment)]
        return bubblewrap.launch(arguments, binds, last, command)

    @contextmanager
    def build(
        self, ros: RosInstallation, folders: Sequence[Path], limits: SandboxLimits = BUILD
    ) -> Iterator[BuildRoom]:
        """Let a part of a build write to folders; the first is its working directory."""
        uid = bubblewrap.build_uid()
        for folder in folders:
            bubblewrap.give(folder, uid)
        try:
            yield BuildRoom(self, ros, tuple(folders), limits, uid)
        finally:
            for folder in folders:
                bubblewrap.take_back(folder)


@dataclass(frozen=True)
class BuildRoom:
    """Where a part of a build runs."""

    sandbox: Sandbox
    ros: RosInstallation
    folders: tuple[Path, ...]
    limits: SandboxLimits = BUILD
    uid: int = bubblewrap.UID
    environment: Mapping[str, str] = field(
        default_factory=lambda: dict(bubblewrap.PLAIN_ENVIRONMENT)
    )
    _cpu: OrphanCpu = field(default_factory=OrphanCpu, repr=False)

    def command(self, command: Sequence[str], environment: Mapping[str, str]) -> list[str]:
        """The command line that runs a command in it."""
        binds = [*self.sandbox.student_view(self.ros), *map(Bind.same, self.ros.underlays)]
        hidden = hide(binds)
        binds += [Bind.same(folder, writable=True) for folder in self.folders]
        arguments = [*bubblewrap.namespaces(_BUILD_UID), "--disable-userns", "--die-with-parent"]
        disk = str(self.limits.disk_bytes)
        arguments += [*bubblewrap.system(), "--size", disk, "--tmpfs", "/tmp"]
        last = [*hidden, *bubblewrap.HIDDEN_INIT, "--remount-ro", "/", "--remount-ro", "/dev"]
        last += ["--chdir", str(self.folders[0]), *bubblewrap.variables(environment)]
        inner = [*self.limits.prlimit(), "--", *command]
        filter_file = self.sandbox.filter_file(student_filter(one_session=True))
        return bubblewrap.launch(arguments, binds, last, inner, filter_file, self.uid)

    def excess(self, usages: Sequence[Usage]) -> str | None:
        """Say which limit the processes of a build have passed, or None."""
        limits = self.limits
        room = limits.memory_bytes - memory_bytes(usages, limits.memory_bytes)
        taken = memory_bytes(usages, limits.memory_bytes, hidden_bytes(usages, room))
        if taken > limits.memory_bytes:
            return f"it took more than {size_words(limits.memory_bytes)} of memory"
        if self._cpu.used_s(usages) > limits.cpu_s:
            return f"it took more than {limits.cpu_s} s of CPU time"
        if sum(usage.threads for usage in usages) >= _NEARLY_ALL * limits.processes:
            return f"it started {limits.processes} processes"
        if open_files(usages) > _OPEN_FILES:
            return f"it had more than {_OPEN_FILES} files open"
        size, files = folder_usage(self.folders, limits.disk_bytes, limits.files)
        if size > limits.disk_bytes:
            return f"it wrote more than {size_words(limits.disk_bytes)}"
        if files > limits.files:
            return f"it made more than {limits.files} files"
        return None


def hide(binds: Sequence[Bind]) -> list[str]:
    """Arguments that cover rosgrade's own code, and the libraries beside our environment.

    With folders that cannot be written to: they are memory that no limit counts.
    """
    return [
        argument
        for path in (*CODE, *_libraries_beside())
        if _is_within(path, [bind for bind in binds if bind.source == bind.target])
        for argument in ("--tmpfs", str(path), "--remount-ro", str(path))
    ]


def _beside(environment: Mapping[str, str]) -> dict[str, str]:
    """Variables by which rosgrade's processes find their environment at :data:`ENVIRONMENT`."""
    moved = {
        name: re.sub(rf"(^|:){re.escape(sys.prefix)}(?=/|:|$)", rf"\1{ENVIRONMENT}", value)
        for name, value in environment.items()
        if name != "PATH"
    }
    own = Path(sys.prefix)
    sites = [str(ENVIRONMENT / path.relative_to(own)) for path in own.glob(_SITE)]
    paths = [path for path in (moved.get("PYTHONPATH"), *sites) if path]
    return {**environment, **moved, "PYTHONPATH": os.pathsep.join(paths)}


def _seen_beside(path: Path) -> Path:
    """Where rosgrade's processes see a path of rosgrade, which may lie in its environment."""
    own = Path(sys.prefix).resolve()
    inside = _in_environment() and path.is_relative_to(own)
    return ENVIRONMENT / path.relative_to(own) if inside else path


def _is_within(path: Path, binds: Iterable[Bind]) -> bool:
    return any(path.is_relative_to(folder) for folder in (Path("/usr"), *(b.target for b in binds)))


def _in_environment() -> bool:
    return sys.prefix != sys.base_prefix


def _libraries_beside() -> list[Path]:
    base = Path(sys.base_prefix).resolve()
    if not _in_environment() or base == _USR:
        return []
    own = [Path(path).resolve() for path in sys.path]
    return [path for path in base.glob(_SITE) if path not in own]


def _python_and_ros(ros: RosInstallation) -> list[Path]:
    """The folders of the interpreter, of its environment and of ROS, none within another."""
    base = Path(sys.base_prefix).resolve()
    folders: list[Path] = []
    for path in (base, Path(sys.prefix), *ros.prefixes):
        if path.is_dir() and not any(path.is_relative_to(other) for other in (_USR, *folders)):
            folders.append(path)
    return folders
