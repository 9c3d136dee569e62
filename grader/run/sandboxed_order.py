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
    folder, shown = cell.folder, [install, *ros.underlays]
    in_cell: dict[str, str] = {}
    seen: dict[str, str] = {}
    for number, path in enumerate(dict.fromkeys([*shown, *map(Path, order.type_support)])):
        place = f"install{number or ''}"
        if path not in cell.shown:
            shutil.copytree(path, folder / place, symlinks=True)
        in_cell[str(path)] = str(cell.shown.get(path, CELL / place))
        if path in shown:
            seen[str(path)] = f"{WORKSPACE}/{place}"
    for program, name in (
        (student_filter(guarded=True), _FILTER),
        (student_filter(), _UNGUARDED),
        (guard_filter(), _GUARD),
    ):
        shutil.copyfile(sandbox.filter_file(program), folder / name)
    (folder / _PASSWD_FILE).write_text(_PASSWD, encoding="utf-8")
    bubblewrap.copy_system_files(folder / _SYSTEM)
    binds = [Bind(Path(in_cell[outside]), Path(inside)) for outside, inside in seen.items()]
    binds.append(Bind.same(TRACER_IN_SANDBOX))
    covered = [
        seen[str(path)] + str(folder).removeprefix(str(path))
        for path in ros.underlays
        for name in sorted(order.hidden)
        for folder in (path / "lib" / name, path / "share" / name, *path.glob(f"{_SITE}/{name}"))
        if folder.is_dir()
    ]
    places = {**seen, str(TRACER): str(TRACER_IN_SANDBOX)}
    if order.compiled_tracer is not None:
        shutil.copyfile(order.compiled_tracer, folder / _COMPILED_TRACER)
        binds.append(Bind(CELL / _COMPILED_TRACER, IN_SANDBOX))
        places[order.compiled_tracer] = str(IN_SANDBOX)
    if order.mutation is not None:
        binds.append(Bind(CELL / Path(order.mutation).name, MUTATION_IN_SANDBOX))
        places[order.mutation] = str(MUTATION_IN_SANDBOX)
    simulator = order.simulator
    if simulator is not None:
        shutil.copyfile(simulator.world, folder / _WORLD)
        simulator = replace(simulator, world=str(CELL / _WORLD))
    own = order.author_simulator
    if own is not None and own.map is not None:
        shutil.copyfile(own.map, folder / _WORLD)
        own = replace(own, map=str(CELL / _WORLD))
    return replace(
        order,
        commands=tuple(replace(one, argv=_moved(one.argv, seen)) for one in order.commands),
        companions=tuple(replace(one, argv=_moved(one.argv, in_cell)) for one in order.companions),
        student_environment=sandboxed_environment(order.student_environment, places),
        # They run in the cell itself, where no program of the student's reaches them.
        companion_environment={
            **sandboxed_environment(order.companion_environment, in_cell),
            **COMPANION_IN_CELL,
        },
        prefixes=_moved(order.prefixes, in_cell),
        type_support=_moved(order.type_support, in_cell),
        scratch=str(CELL),
        simulator=simulator,
        author_simulator=own,
        process_sandbox=ProcessSandbox(
            arguments=(*_arguments(sandbox, ros, binds, covered), "--chdir", HOME),
            filter=str(CELL / _FILTER),
            unguarded=str(CELL / _UNGUARDED),
            guard=str(CELL / _GUARD),
            calls=guarded_calls(),
            limits=limits,
            folders={inside: in_cell[outside] for outside, inside in seen.items()},
        ),
        environment={**order.environment, "sandbox": sandbox.description},
    )


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


def _moved(paths: Iterable[str], places: dict[str, str]) -> tuple[str, ...]:
    moved = list(paths)
    for number, text in enumerate(moved):
        # An argument of a launch file is `name:=path`.
        name, given, path = text.rpartition(":=")
        for outside, inside in places.items():
            if path == outside or path.startswith(f"{outside}/"):
                moved[number] = name + given + inside + path[len(outside) :]
                break
    return tuple(moved)
