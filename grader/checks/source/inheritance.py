"""What the classes of a submission inherit: by import, alias, and own base classes.

What names stand for is found out from the facts of the source, never by an import.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import NamedTuple

from grader.submission.read.code_facts import SourceClass, SourceFile

NODE = "rclpy.node.Node"

# Classes of rclpy that are nodes as well.
_NODES = {
    NODE,
    "rclpy.lifecycle.LifecycleNode",
    "rclpy.lifecycle.Node",
    "rclpy.lifecycle.node.LifecycleNode",
    "rclpy.lifecycle.node.LifecycleNodeMixin",
}
_MOST_STEPS = 200


class FoundClass(NamedTuple):
    """A class with the file that it is in."""

    file: SourceFile
    found: SourceClass


class Family:
    """The classes of some files, and what they inherit."""

    def __init__(self, files: Sequence[SourceFile]) -> None:
        self.classes = [FoundClass(file, one) for file in files for one in file.classes]
        self._modules = {file.module: file for file in files}

    def inherits(self, item: FoundClass, base: str) -> bool:
        """Whether a class inherits another one, as far as the files tell."""
        return bool(self._ancestors(item) & (_NODES if base == NODE else {base}))

    def foreign(self, item: FoundClass) -> list[str]:
        """Classes that it inherits from packages that were not handed in."""
        return sorted(
            name
            for name in self._ancestors(item)
            if "." in name
            and name.partition(".")[0] not in ("rclpy", *sys.stdlib_module_names)
            and self._split(name)[0] is None
        )

    def _ancestors(self, item: FoundClass) -> set[str]:
        """Dotted names of everything that a class inherits."""
        pending = _bases(item)
        known: set[str] = set()
        while pending and len(known) < _MOST_STEPS:
            name = pending.pop()
            module, rest = self._split(name)
            if name in known or module is None:
                known.add(name)
                continue
            known.add(name)
            own = next((one for one in module.classes if one.name == rest), None)
            if own is not None:
                pending += _bases(FoundClass(module, own))
            else:
                # A name that the module itself has from elsewhere, such as in __init__.py.
                pending += [found for found in _named(rest, module) if found != rest]
        return known

    def _split(self, name: str) -> tuple[SourceFile | None, str]:
        """The file of the longest module that a dotted name begins with, and the rest."""
        parts = name.split(".")
        for end in range(len(parts) - 1, 0, -1):
            module = self._modules.get(".".join(parts[:end]))
            if module is not None:
                return module, ".".join(parts[end:])
        return None, ""


def _bases(item: FoundClass) -> list[str]:
    """What the base classes of a class may be, by their dotted names."""
    file, inheriting = item
    names = {one.name for one in file.classes if one is not inheriting}
    scope = inheriting.name.split(".")[:-1]
    found: list[str] = []
    for base in inheriting.bases:
        # A class of the same file, the nearest scope first.
        nested = [".".join([*scope[:end], base]) for end in range(len(scope), -1, -1)]
        own = next((name for name in nested if name in names), None)
        found += [f"{file.module}.{own}"] if own else _named(base, file)
    return found


def _named(dotted: str, file: SourceFile) -> list[str]:
    """What a name in a file may stand for; the name itself if the file says nothing of it."""
    head, _, rest = dotted.partition(".")
    names = dict(file.names)
    tail = f".{rest}" if rest else ""
    seen: set[str] = set()
    # An alias of an alias, as in `Base = N` after `from rclpy.node import Node as N`.
    while head in names and head not in seen:
        seen.add(head)
        first, _, more = names[head].partition(".")
        if first == head or first not in names:
            return [names[head] + tail]
        head, tail = first, (f".{more}" if more else "") + tail
    return [f"{module}.{dotted}" for module in file.stars] or [dotted]
