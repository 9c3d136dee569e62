"""A mistake that a run imposes on a right program, as if the program made it."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from grader.machine.resources import cache_folder
from grader.machine.ros import RosInstallation
from grader.run.compiled_tracer import build_library
from grader.run.order import CellOrder

IN_SANDBOX = Path("/opt/mutation")
_HERE = Path(__file__).resolve().parent


@dataclass(frozen=True)
class Mistake:
    """One thing that a program does otherwise than it says.

    Attributes:
        program: Name of the executable.
        kind: What is different, as in mutation.c.
        name: What it is about, such as a topic as the program resolves it.
        value: What stands there instead.
    """

    program: str
    kind: str
    name: str
    value: str


def with_mistakes(
    order: CellOrder, mistakes: Sequence[Mistake], folder: Path, ros: RosInstallation
) -> CellOrder:
    """Order that mistakes are imposed, and write into the cell's folder what does it."""
    place = folder / "mutation"
    place.mkdir()
    lines = (f"{one.program}\t{one.kind}\t{one.name}\t{one.value}\n" for one in mistakes)
    (place / "mutation.txt").write_text("".join(lines), encoding="utf-8")
    shutil.copy(_HERE / "sitecustomize.py", place)
    # Each stands before the tracer of its language: it tells the tracer what is wrong, too.
    before = {"PYTHONPATH": place}
    if order.compiled_tracer is not None:
        library = build_library(_HERE / "mutation.c", ros, cache_folder())
        assert library is not None
        before["LD_PRELOAD"] = Path(shutil.copyfile(library, place / "mutation.so"))
    usual = order.student_environment
    joined = {name: f"{path}{os.pathsep}{usual[name]}" for name, path in before.items()}
    return replace(order, student_environment=usual | joined, mutation=str(place))
