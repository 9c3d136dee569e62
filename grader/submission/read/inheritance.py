"""What the classes of a submission inherit: by import, alias, and own base classes.

What names stand for is found out from the facts of the source, never by an import or a compiler.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
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
        ancestors = map(self._class, self._ancestors(item))
        return [one for one in ancestors if one is not None and one.found is not item.found]

    def heirs(self, item: FoundClass) -> list[FoundClass]:
        """The classes that inherit it."""
        return [
            heir
            for heir in self.classes
            if any(ancestor.found is item.found for ancestor in self.own_ancestors(heir))
        ]

    def inherited(self, item: FoundClass, method: str) -> list[SourceFunction]:
        """What its own base classes declare by the name of a method, nearest first."""
        return [
            declared
            for ancestor in self.own_ancestors(item)
            for declared in methods(ancestor)
            if declared.short == method
        ]

    def is_abstract(self, item: FoundClass) -> bool:
        """Whether no object can be made of it, as a method of it is declared and not defined."""
        lineage = [item, *self.own_ancestors(item)]
        is_pure: dict[tuple[str, int | None], bool] = {}
        for each in lineage:
            for method in methods(each):
                # The nearest declaration of a method counts.
                is_pure.setdefault((method.short, method.parameters), method.pure)
        if _is_cpp(item) or not any(is_pure.values()):
            return any(is_pure.values())
        # In Python, abstractmethod() does nothing without the metaclass.
        metaclasses = (_meanings(each.found.metaclass, each.file)[0] for each in lineage)
        return not _ABSTRACT.isdisjoint((*self._ancestors(item), *metaclasses))

    def _ancestors(self, item: FoundClass) -> dict[str, None]:
        """Names of everything that a class inherits, with their modules or namespaces, in order."""
        ancestors = self._ancestors_of.get(id(item.found))
        if ancestors is None:
            ancestors = dict.fromkeys(self._bases_cpp(item) if _is_cpp(item) else _bases(item))
            pending = list(ancestors)
            for name in pending:
                new = [base for base in self._beyond(name) if base not in ancestors]
                ancestors.update(dict.fromkeys(new))
                pending += new
            self._ancestors_of[id(item.found)] = ancestors
        return ancestors

    def _beyond(self, name: str) -> list[str]:
        """What a class inherits, or what its name stands for in its module."""
        if name in self._cpp:
            return self._bases_cpp(self._cpp[name])
        module, rest = self._split(name)
        if module is None:
            return []
        own = self._class(name)
        # What is no class there the module has from elsewhere, such as in __init__.py.
        return _bases(own) if own else _meanings(rest, module)

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
        bases = [
            self._class_around(base, item) or self._meant(base, item) for base in item.found.bases
        ]
        return list(dict.fromkeys(bases))

    def _class_around(self, base: str, item: FoundClass) -> str | None:
        """The class of a name in the namespaces around a class, or that it uses; or None."""
        for scope in (*_scopes(item.found.name), *(f"{name}::" for name in item.file.stars)):
            own = self._cpp.get(f"{scope}{base}")
            if own is not None and own.found is not item.found:
                return own.found.name
        return None

    def _meant(self, base: str, item: FoundClass) -> str:
        """What a name stands for that no class around has."""
        base, _ = _without_aliases(base, {**self._names_cpp, **dict(item.file.names)}, "::")
        # Of what `using namespace` of another file may bring, the one of that name.
        last = base.rpartition("::")[2]
        of_that_name = [name for name in self._cpp if name.rpartition("::")[2] == last]
        if (
            base not in self._cpp
            and len(of_that_name) == 1
            and of_that_name[0].endswith(f"::{base}")
        ):
            return of_that_name[0]
        if base == "Node" and "rclcpp" in item.file.stars:
            return "rclcpp::Node"
        return base


def methods(item: FoundClass) -> Iterator[SourceFunction]:
    """The methods that a class declares itself."""
    file, found = item
    separator = "::" if _is_cpp(item) else "."
    for function in file.functions:
        is_inside = not found.end or found.line <= function.line <= found.end
        if is_inside and function.name == f"{found.name}{separator}{function.short}":
            yield function


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
    bases: list[str] = []
    for base in inheriting.bases:
        # A class beside it in the same function or class, or else one of the file.
        if f"{scope}.{base}" in names:
            bases.append(f"{file.module}.{scope}.{base}")
        elif base in names:
            bases.append(f"{file.module}.{base}")
        else:
            bases += _meanings(base, file)
    return bases


def _meanings(dotted: str, file: SourceFile) -> list[str]:
    """What a name in a file may stand for; the name itself if the file says nothing of it."""
    full, is_alias = _without_aliases(dotted, dict(file.names), ".")
    if is_alias or not file.stars:
        return [full]
    return [f"{module}.{dotted}" for module in file.stars]


def _without_aliases(name: str, names: Mapping[str, str], separator: str) -> tuple[str, bool]:
    """A name with what its first part stands for, and whether that stood for something else.

    An alias may be of another one: `Base = N` after `from rclpy.node import Node as N`.
    """
    replaced: set[str] = set()
    while (head := name.partition(separator)[0]) in names and head not in replaced:
        replaced.add(head)
        name = names[head] + name[len(head) :]
    return name, bool(replaced)
