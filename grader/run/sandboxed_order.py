"""An order for a cell in a sandbox, from the same order for one without.

A cell in a sandbox sees nothing but its own folder and the underlays of the machine, so what else
the order names is copied there: the student's install space and the world. And the student, in a
sandbox within, sees of that only what is installed.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from grader.machine.ros import RosInstallation
from grader.run.cell.cell_process import CellProcess
from grader.run.compiled_tracer import IN_SANDBOX
from grader.run.environment import (
    COMPANION_IN_CELL,
    TRACER,
    TRACER_IN_SANDBOX,
    sandboxed_environment,
)
from grader.run.imposing.mistake import IN_SANDBOX as MUTATION_IN_SANDBOX
from grader.run.order import CellOrder
from grader.run.process.process_sandbox import HOME, WORKSPACE, ProcessSandbox
from grader.sandbox import bubblewrap
from grader.sandbox.bubblewrap import Bind
from grader.sandbox.limits import SandboxLimits
from grader.sandbox.namespaces import CELL, STUDENT
from grader.sandbox.sandbox import TREES, Sandbox, hide
from grader.sandbox.seccomp import guard_filter, guarded_calls, student_filter

_UID = 1000
_PASSWD = f"student:x:{_UID}:{_UID}::{HOME}:/bin/sh\n"
_FILTER, _UNGUARDED, _GUARD = "student.bpf", "unguarded.bpf", "guard.bpf"
_WORLD, _PASSWD_FILE, _COMPILED_TRACER = "world.yaml", "passwd", "tracer.so"
_SYSTEM = "system"
_SITE = "lib/python3*/site-packages"


def sandboxed(
    order: CellOrder,
    cell: CellProcess,
    sandbox: Sandbox,
    ros: RosInstallation,
    install: Path,
    limits: SandboxLimits,
) -> CellOrder:
    """Make an order for a sandbox, and copy into the cell's folder what it needs."""
    folder, for_student = cell.folder, [install, *ros.underlays]
    in_cell: dict[str, str] = {}
    in_sandbox: dict[str, str] = {}
    prefixes = dict.fromkeys([*for_student, *map(Path, order.type_support)])
    for number, prefix in enumerate(prefixes):
        place = f"install{number or ''}"
        if prefix not in cell.shown:
            shutil.copytree(prefix, folder / place, symlinks=True)
        in_cell[str(prefix)] = str(cell.shown.get(prefix, CELL / place))
        if prefix in for_student:
            in_sandbox[str(prefix)] = f"{WORKSPACE}/{place}"
    _copy_system_files(folder, sandbox)
    binds = [Bind(Path(in_cell[outside]), Path(inside)) for outside, inside in in_sandbox.items()]
    binds.append(Bind.same(TRACER_IN_SANDBOX))
    covered = [
        in_sandbox[str(prefix)] + str(path).removeprefix(str(prefix))
        for prefix in ros.underlays
        for path in _folders_of(order.hidden, prefix)
    ]
    places = {**in_sandbox, str(TRACER): str(TRACER_IN_SANDBOX)}
    if order.compiled_tracer is not None:
        shutil.copyfile(order.compiled_tracer, folder / _COMPILED_TRACER)
        binds.append(Bind(CELL / _COMPILED_TRACER, IN_SANDBOX))
        places[order.compiled_tracer] = str(IN_SANDBOX)
    if order.mutation is not None:
        binds.append(Bind(CELL / Path(order.mutation).name, MUTATION_IN_SANDBOX))
        places[order.mutation] = str(MUTATION_IN_SANDBOX)
    simulator, author_simulator = order.simulator, order.author_simulator
    if simulator is not None:
        shutil.copyfile(simulator.world, folder / _WORLD)
        simulator = replace(simulator, world=str(CELL / _WORLD))
    if author_simulator is not None and author_simulator.map is not None:
        shutil.copyfile(author_simulator.map, folder / _WORLD)
        author_simulator = replace(author_simulator, map=str(CELL / _WORLD))
    return replace(
        order,
        commands=tuple(
            replace(command, argv=_moved(command.argv, in_sandbox)) for command in order.commands
        ),
        # They run in the cell itself, where no program of the student's reaches them.
        companions=tuple(
            replace(program, argv=_moved(program.argv, in_cell)) for program in order.companions
        ),
        companion_environment={
            **sandboxed_environment(order.companion_environment, in_cell),
            **COMPANION_IN_CELL,
        },
        student_environment=sandboxed_environment(order.student_environment, places),
        prefixes=_moved(order.prefixes, in_cell),
        type_support=_moved(order.type_support, in_cell),
        scratch=str(CELL),
        simulator=simulator,
        author_simulator=author_simulator,
        process_sandbox=ProcessSandbox(
            arguments=(*_arguments(sandbox, ros, binds, covered), "--chdir", HOME),
            filter=str(CELL / _FILTER),
            unguarded=str(CELL / _UNGUARDED),
            guard=str(CELL / _GUARD),
            calls=guarded_calls(),
            limits=limits,
            folders={inside: in_cell[outside] for outside, inside in in_sandbox.items()},
        ),
        environment={**order.environment, "sandbox": sandbox.description},
    )


def _copy_system_files(folder: Path, sandbox: Sandbox) -> None:
    """Put filters of system calls, and what of /etc the student sees, into the cell's folder."""
    filters = {
        _FILTER: student_filter(guarded=True),
        _UNGUARDED: student_filter(),
        _GUARD: guard_filter(),
    }
    for name, program in filters.items():
        shutil.copyfile(sandbox.filter_file(program), folder / name)
    (folder / _PASSWD_FILE).write_text(_PASSWD, encoding="utf-8")
    bubblewrap.copy_system_files(folder / _SYSTEM)


def _folders_of(packages: Iterable[str], prefix: Path) -> list[Path]:
    """The folders of some packages in an install space."""
    folders = []
    for name in sorted(packages):
        folders += [prefix / "lib" / name, prefix / "share" / name]
        folders += prefix.glob(f"{_SITE}/{name}")
    return [folder for folder in folders if folder.is_dir()]


def _arguments(
    sandbox: Sandbox, ros: RosInstallation, binds: Sequence[Bind], covered: Sequence[str]
) -> list[str]:
    python = sandbox.student_view(ros, TREES)
    disk, shared = STUDENT / "disk", STUDENT / "shared"
    writable = (
        Bind(disk / "tmp", Path("/tmp"), writable=True),
        Bind(disk / "home", Path(HOME), writable=True),
        Bind(shared, Path("/dev/shm"), writable=True),
    )
    return [
        *bubblewrap.namespaces(_UID, network=False),
        *("--disable-userns", "--hostname", "student"),
        *bubblewrap.system(CELL / _SYSTEM),
        *("--ro-bind", str(CELL / _PASSWD_FILE), "/etc/passwd"),
        # What can be written to comes first: Python may be installed below /tmp.
        *bubblewrap.bound((*writable, *python, *binds)),
        *hide(python),
        *(word for path in covered for word in ("--tmpfs", path, "--remount-ro", path)),
        *bubblewrap.HIDDEN_INIT,
        *("--remount-ro", "/", "--remount-ro", "/dev"),
    ]


def _moved(texts: Iterable[str], places: dict[str, str]) -> tuple[str, ...]:
    """The same paths, or arguments of commands, with the places at which they are seen inside."""
    return tuple(_moved_one(text, places) for text in texts)


def _moved_one(text: str, places: dict[str, str]) -> str:
    # An argument of a launch file is `name:=path`.
    name, separator, path = text.rpartition(":=")
    for outside, inside in places.items():
        if path == outside or path.startswith(f"{outside}/"):
            return name + separator + inside + path.removeprefix(outside)
    return text
