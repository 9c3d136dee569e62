"""Whether a class of a submission inherits another one: by import, alias, and own base classes.

Pure: what names stand for is found out from the facts of the source, never by an import.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum

from grader.submission.read.code_facts import SourceClass, SourceFile

NODE = "rclpy.node.Node"

# Classes of rclpy that are nodes as well.
_SAME = {
    NODE: frozenset(
        {
            NODE,
            "rclpy.lifecycle.LifecycleNode",
            "rclpy.lifecycle.Node",
            "rclpy.lifecycle.node.LifecycleNode",
            "rclpy.lifecycle.node.LifecycleNodeMixin",
        }
    )
}
_MOST_STEPS = 200


class Kinship(Enum):
    """What can be said of a class and a base class."""

    YES = "yes"
    NO = "no"
    UNKNOWN = "unknown"
    """It inherits a class from a package that was not handed in."""


@dataclass(frozen=True)
class FoundClass:
    """A class with the file that it is in."""

    file: SourceFile
    found: SourceClass


class Family:
    """The classes of some files, and what they inherit."""

    def __init__(self, files: Sequence[SourceFile]) -> None:
        """Index the files by their modules."""
        self._files = files
        self._modules = {file.module: file for file in files}

    @property
    def classes(self) -> tuple[FoundClass, ...]:
        """Every class, in the order of files and lines."""
        return tuple(FoundClass(file, one) for file in self._files for one in file.classes)

    def ancestors(self, item: FoundClass) -> set[str]:
        """Dotted names of everything that a class inherits, as far as the files tell."""
        pending = self._resolved(item.found.bases, item.file, item.found)
        known: set[str] = set()
        while pending and len(known) < _MOST_STEPS:
            name = pending.pop()
            if name in known:
                continue
            known.add(name)
            module, rest = self._split(name)
            if module is None:
                continue
            own = next((one for one in module.classes if one.name == rest), None)
            if own is not None:
                pending += self._resolved(own.bases, module, own)
            else:
                # A name that the module itself has from elsewhere, such as in __init__.py.
                pending += [found for found in _named(rest, module) if found != rest]
        return known

    def inherits(self, item: FoundClass, base: str) -> Kinship:
        """Whether a class inherits another one."""
        ancestors = self.ancestors(item)
        if ancestors & _SAME.get(base, frozenset({base})):
            return Kinship.YES
        return Kinship.UNKNOWN if any(map(self._is_foreign, ancestors)) else Kinship.NO

    def foreign(self, item: FoundClass) -> list[str]:
        """Classes that it inherits from packages that were not handed in."""
        return sorted(filter(self._is_foreign, self.ancestors(item)))

    def _is_foreign(self, name: str) -> bool:
        top, _, rest = name.partition(".")
        if not rest or top == "rclpy" or top in sys.stdlib_module_names:
            return False
        return self._split(name)[0] is None

    def _resolved(
        self, bases: Iterable[str], file: SourceFile, inheriting: SourceClass
    ) -> list[str]:
        found: list[str] = []
        for base in bases:
            own = _class_in(base, file, inheriting)
            found += [f"{file.module}.{own}"] if own else _named(base, file)
        return found

    def _split(self, name: str) -> tuple[SourceFile | None, str]:
        """The file of the longest module that a dotted name begins with, and the rest."""
        parts = name.split(".")
        for end in range(len(parts) - 1, 0, -1):
            module = self._modules.get(".".join(parts[:end]))
            if module is not None:
                return module, ".".join(parts[end:])
        return None, ""


def _class_in(base: str, file: SourceFile, inheriting: SourceClass) -> str | None:
    """The class of the same file that a base class is, the nearest scope first."""
    names = {one.name for one in file.classes if one is not inheriting}
    scope = inheriting.name.split(".")[:-1]
    for end in range(len(scope), -1, -1):
        name = ".".join([*scope[:end], base])
        if name in names:
            return name
    return None


def _named(dotted: str, file: SourceFile) -> list[str]:
    """What a name in a file may stand for; the name itself if the file says nothing of it."""
    head, _, rest = dotted.partition(".")
    names = dict(file.names)
    tail = f".{rest}" if rest else ""
    seen: set[str] = set()
    # An alias of an alias, as in `Base = N` after `from rclpy.node import Node as N`.
    while head in names and head not in seen:
        seen.add(head)
        target = names[head]
        first, _, more = target.partition(".")
        if first == head or first not in names:
            return [target + tail]
        head, tail = first, (f".{more}" if more else "") + tail
    return [f"{module}.{dotted}" for module in file.stars] or [dotted]
