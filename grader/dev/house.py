"""The house in figures, for ``make lint``: its rooms floor by floor, its longest parameter list.

A room is a package directly below ``grader``. Its floor is one above the highest of those that it
imports from.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from graphlib import TopologicalSorter
from pathlib import Path

from grader.machine.resources import PACKAGE


def imports_between_rooms(folder: Path = PACKAGE) -> dict[str, set[str]]:
    """The rooms that each room imports from; what only types need does not count."""
    rooms = {item.name for item in folder.iterdir() if (item / "__init__.py").is_file()}
    found: dict[str, set[str]] = {room: set() for room in sorted(rooms)}
    for room in rooms:
        for file in (folder / room).rglob("*.py"):
            found[room] |= {*_imported(ast.parse(file.read_bytes()))} & rooms - {room}
    return found


def floors(imports: Mapping[str, set[str]]) -> dict[str, int]:
    """The floor of each room, from 1; raises CycleError where rooms import each other."""
    found: dict[str, int] = {}
    for room in TopologicalSorter(imports).static_order():
        found[room] = 1 + max((found[other] for other in imports[room]), default=0)
    return found


def parameters(folder: Path = PACKAGE) -> Iterator[tuple[int, str]]:
    """How many parameters each function has that is no command, and where it is."""
    for file in sorted(folder.rglob("*.py")):
        if file.parent.name != "cli":
            for node in ast.walk(ast.parse(file.read_bytes())):
                if isinstance(node, ast.FunctionDef):
                    given = node.args
                    names = [*given.posonlyargs, *given.args, *given.kwonlyargs]
                    number = len([one for one in names if one.arg not in ("self", "cls")])
                    yield number, f"{file.relative_to(folder)}: {node.name}"


def lines(folder: Path) -> int:
    """Lines of Python in a folder."""
    return sum(file.read_bytes().count(b"\n") for file in folder.rglob("*.py"))


def _imported(node: ast.AST) -> Iterator[str]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.ImportFrom) and child.module:
            parts = child.module.split(".")
            if parts[0] == "grader":
                yield from parts[1:2] or [name.name for name in child.names]
        elif not (isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test)):
            yield from _imported(child)


def main() -> None:
    """Print the house."""
    by_floor = floors(imports_between_rooms())
    for floor in range(max(by_floor.values()), 0, -1):
        here = [room for room, its in by_floor.items() if its == floor]
        print(
            f"{floor:3}  " + ", ".join(f"{room} {lines(PACKAGE / room)}" for room in sorted(here))
        )
    sizes = {name: lines(PACKAGE.parent / name) for name in ("grader", "sim", "tests")}
    print("lines: " + ", ".join(f"{name} {size}" for name, size in sizes.items()))
    number, place = max(parameters())
    print(f"most parameters: {number}, {place}")


if __name__ == "__main__":
    main()
