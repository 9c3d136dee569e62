"""The house in figures, for ``make lint``: its rooms floor by floor, its longest parameter list.

A room is a package directly below ``grader``. Its floor is one above the highest of those that it
imports from.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from graphlib import TopologicalSorter
from pathlib import Path

import grimp

from grader.machine.resources import PACKAGE


def imports_between_rooms() -> dict[str, set[str]]:
    """The rooms that each room imports from; what only types need does not count."""
    graph = grimp.build_graph("grader", exclude_type_checking_imports=True, cache_dir=None)
    rooms = [one for one in sorted(graph.find_children("grader")) if graph.find_children(one)]
    return {
        room.removeprefix("grader."): {
            other.removeprefix("grader.")
            for other in rooms
            if other != room
            and graph.direct_import_exists(importer=room, imported=other, as_packages=True)
        }
        for room in rooms
    }


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
