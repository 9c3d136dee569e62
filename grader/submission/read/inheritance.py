"""What the classes of a submission inherit: by import, alias, and own base classes.

What names stand for is found out from the facts of the source, never by an import or a compiler.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from grader.recording.submission import CPP, SourceClass, SourceFile, SourceFunction

NODE = "rclpy.node.Node"

# Classes of rclpy and rclcpp that are nodes as well.
_NODES = {
    NODE,
    "rclpy.lifecycle.LifecycleNode",
    "rclpy.lifecycle.Node",
    "rclpy.lifecycle.node.LifecycleNode",
    "rclpy.lifecycle.node.LifecycleNodeMixin",
    "rclcpp::Node",
    "rclcpp_lifecycle::LifecycleNode",
}
_NAMES_OF_NODE = (NODE, "rclcpp::Node", "Node")
_ABSTRACT = {"abc.ABC", "abc.ABCMeta"}
_KNOWN_CPP = ("rclcpp", "rclcpp_lifecycle", "std")


class FoundClass(NamedTuple):
    """A class with the file that it is in."""

    file: SourceFile
    found: SourceClass


class Family:
    """The classes of some files, and what they inherit."""

    def __init__(self, files: Sequence[SourceFile]) -> None:
        self.classes = [FoundClass(file, one) for file in files for one in file.classes]
        self._modules = {file.module: file for file in files if file.language != CPP}
        self._cpp = {item.found.name: item for item in self.classes if _is_cpp(item)}
        # A header's names are those of the files that include it.
        self._names_cpp = {
            own: known for file in files if file.language == CPP for own, known in file.names
        }
        self._ancestors_of: dict[int, dict[str, None]] = {}

    def inherits(self, item: FoundClass, base: str) -> bool:
        """Whether a class inherits another one, as far as the files tell.

        Args:
            base: With its module or namespace, or its name alone.
        """
        ancestors = self._ancestors(item)
        if base in _NAMES_OF_NODE:
            return not _NODES.isdisjoint(ancestors)
        if "." in base or "::" in base:
            return base in ancestors
        return base in {name.replace("::", ".").rpartition(".")[2] for name in ancestors}

    def foreign(self, item: FoundClass) -> list[str]:
        """Classes that it inherits from packages that were not handed in."""
        if _is_cpp(item):
            names = [name for name in self._ancestors(item) if name not in self._cpp]
            return sorted(name for name in names if name.split("::")[0] not in _KNOWN_CPP)
        known = ("rclpy", *sys.stdlib_module_names)
        names = [name for name in self._ancestors(item) if self._split(name)[0] is None]
        return sorted(name for name in names if "." in name and name.split(".")[0] not in known)

    def own_ancestors(self, item: FoundClass) -> list[FoundClass]:
        """The classes that it inherits and that were handed in, nearest first."""
        found = map(self._class, self._ancestors(item))
        return [one for one in found if one is not None and one.found is not item.found]

    def heirs(self, item: FoundClass) -> list[FoundClass]:
        """The classes that inherit it."""
        found = item.found
        return [
            one
            for one in self.classes
            if any(ancestor.found is found for ancestor in self.own_ancestors(one))
        ]

    def inherited(self, item: FoundClass, method: str) -> list[SourceFunction]:
        """What its own base classes declare by the name of a method, nearest first."""
        return [
            one
            for ancestor in self.own_ancestors(item)
            for one in methods(ancestor)
            if one.short == method
        ]

    def is_abstract(self, item: FoundClass) -> bool:
        """Whether no object can be made of it, as a method of it is declared and not defined."""
        line = [item, *self.own_ancestors(item)]
        nearest: dict[tuple[str, int | None], bool] = {}
        for one in line:
            for method in methods(one):
                nearest.setdefault((method.short, method.parameters), method.pure)
        if _is_cpp(item):
            return any(nearest.values())
        # In Python, abstractmethod() does nothing without the metaclass.
        metaclasses = (_named(one.found.metaclass, one.file)[0] for one in line)
        return any(nearest.values()) and not _ABSTRACT.isdisjoint(
            (*self._ancestors(item), *metaclasses)
        )

    def _ancestors(self, item: FoundClass) -> dict[str, None]:
        """Names of everything that a class inherits, with their modules or namespaces, in order."""
        known = self._ancestors_of.get(id(item.found))
        if known is None:
            known = dict.fromkeys(self._bases_cpp(item) if _is_cpp(item) else _bases(item))
            pending = list(known)
            for name in pending:
                more = [one for one in self._beyond(name) if one not in known]
                known.update(dict.fromkeys(more))
                pending += more
            self._ancestors_of[id(item.found)] = known
        return known

    def _beyond(self, name: str) -> list[str]:
        """What a class inherits, or what its name stands for in its module."""
        if name in self._cpp:
            return self._bases_cpp(self._cpp[name])
        module, rest = self._split(name)
        if module is None:
            return []
        own = self._class(name)
        # What is no class there the module has from elsewhere, such as in __init__.py.
        return _bases(own) if own else _named(rest, module)

    def _class(self, name: str) -> FoundClass | None:
        """The class of a full name, if it was handed in."""
        module, rest = self._split(name)
        if module is None:
            return self._cpp.get(name)
        own = next((one for one in module.classes if one.name == rest), None)
        return FoundClass(module, own) if own else None

    def _split(self, name: str) -> tuple[SourceFile | None, str]:
        """The file of the longest module that a dotted name begins with, and the rest."""
        parts = name.split(".")
        for end in range(len(parts) - 1, 0, -1):
            module = self._modules.get(".".join(parts[:end]))
            if module is not None:
                return module, ".".join(parts[end:])
        return None, ""

    def _bases_cpp(self, item: FoundClass) -> list[str]:
        """What the base classes of a class in C++ are, with their namespaces."""
        found = []
        for base in item.found.bases:
            for scope in (*_scopes(item.found.name), *(f"{name}::" for name in item.file.stars)):
                own = self._cpp.get(f"{scope}{base}")
                if own is not None and own.found is not item.found:
                    found.append(own.found.name)
                    break
            else:
                found.append(self._meant(base, item))
        return list(dict.fromkeys(found))

    def _meant(self, base: str, item: FoundClass) -> str:
        """What a name stands for that no class around has."""
        names = {**self._names_cpp, **dict(item.file.names)}
        seen: set[str] = set()
        while (head := base.partition("::")[0]) in names and head not in seen:
            seen.add(head)
            base = names[head] + base[len(head) :]
        # Of what `using namespace` of another file may bring, the one of that name.
        last = base.rpartition("::")[2]
        like = [name for name in self._cpp if name.rpartition("::")[2] == last]
        if base not in self._cpp and len(like) == 1 and like[0].endswith(f"::{base}"):
            return like[0]
        if base == "Node" and "rclcpp" in item.file.stars:
            return "rclcpp::Node"
        return base


def methods(item: FoundClass) -> Iterator[SourceFunction]:
    """The methods that a class declares itself."""
    file, found = item
    separator = "::" if _is_cpp(item) else "."
    for one in file.functions:
        inside = not found.end or found.line <= one.line <= found.end
        if inside and one.name == f"{found.name}{separator}{one.short}":
            yield one


def _is_cpp(item: FoundClass) -> bool:
    return item.file.language == CPP


def _scopes(name: str) -> Iterator[str]:
    """What may stand before a name in a class: ``a::b::``, ``a::``, nothing."""
    while name:
        name = name.rpartition("::")[0]
        yield f"{name}::" if name else ""


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
