"""What the classes of a submission inherit: by import, alias, and own base classes.

What names stand for is found out from the facts of the source, never by an import.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import NamedTuple

from grader.recording.submission import SourceClass, SourceFile

NODE = "rclpy.node.Node"

# Classes of rclpy that are nodes as well.
_NODES = {
    NODE,
    "rclpy.lifecycle.LifecycleNode",
    "rclpy.lifecycle.Node",
    "rclpy.lifecycle.node.LifecycleNode",
    "rclpy.lifecycle.node.LifecycleNodeMixin",
}


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
        return bool({*self._ancestors(item)} & (_NODES if base == NODE else {base}))

    def foreign(self, item: FoundClass) -> list[str]:
        """Classes that it inherits from packages that were not handed in."""
        known = ("rclpy", *sys.stdlib_module_names)
        names = [name for name in self._ancestors(item) if self._split(name)[0] is None]
        return sorted(name for name in names if "." in name and name.split(".")[0] not in known)

    def _ancestors(self, item: FoundClass) -> list[str]:
        """Dotted names of everything that a class inherits."""
        known = _bases(item)
        for name in known:
            module, rest = self._split(name)
            if module is not None:
                own = next((one for one in module.classes if one.name == rest), None)
                # What is no class there the module has from elsewhere, such as in __init__.py.
                more = _bases(FoundClass(module, own)) if own else _named(rest, module)
                known += [found for found in more if found not in known]
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
    scope = inheriting.name.rpartition(".")[0]
    found: list[str] = []
    for base in inheriting.bases:
        # A class beside it in the same function or class, or else one of the file.
        own = next((name for name in (f"{scope}.{base}", base) if name in names), None)
        found += [f"{file.module}.{own}"] if own else _named(base, file)
    return found


def _named(dotted: str, file: SourceFile) -> list[str]:
    """What a name in a file may stand for; the name itself if the file says nothing of it."""
    names, seen, found = dict(file.names), set[str](), dotted
    # An alias of an alias, as in `Base = N` after `from rclpy.node import Node as N`.
    while (head := found.partition(".")[0]) in names and head not in seen:
        seen.add(head)
        found = names[head] + found[len(head) :]
    stars = [f"{module}.{dotted}" for module in file.stars]
    return [found] if seen or not stars else stars
