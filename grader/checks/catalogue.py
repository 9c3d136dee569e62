"""The catalogue of checks: every check by its name.

A family is a package beside this module, named as the first part of the names of its checks; a
check is an object that one of its modules makes with :func:`grader.checks.check.check`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from types import MappingProxyType, ModuleType

from grader import checks
from grader.checks.check import Check


def gather(modules: Iterable[ModuleType]) -> Mapping[str, Check]:
    """Collect the checks that are defined in modules, in the order of their definition.

    Raises:
        ValueError: Two checks have the same name.
    """
    found: dict[str, Check] = {}
    for module in modules:
        for item in vars(module).values():
            if not isinstance(item, Check):
                continue
            if item.name in found:
                raise ValueError(f"two checks are called {item.name!r}")
            found[item.name] = item
    return MappingProxyType(found)


def families() -> list[str]:
    """First parts of the names of checks: each is a package beside this module."""
    return sorted(found.name for found in iter_modules(checks.__path__) if found.ispkg)


@cache
def _family(family: str) -> Mapping[str, Check]:
    if family not in families():
        return MappingProxyType({})
    package = import_module(f"{checks.__name__}.{family}")
    names = sorted(found.name for found in iter_modules(package.__path__))
    # What the whole family is about comes first.
    names.sort(key=lambda name: name != family)
    return gather(import_module(f"{package.__name__}.{name}") for name in names)


class _Catalogue(Mapping[str, Check]):
    """Imports a family when one of its checks is asked for: numpy alone takes 0.1 s."""

    def __getitem__(self, name: str) -> Check:
        return _family(name.partition(".")[0])[name]

    def __iter__(self) -> Iterator[str]:
        for family in families():
            yield from _family(family)

    def __len__(self) -> int:
        return sum(1 for _ in self)


CATALOGUE: Mapping[str, Check] = _Catalogue()
