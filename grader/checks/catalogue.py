"""The catalogue of checks: every check by its name."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib import import_module
from types import MappingProxyType, ModuleType

from grader.checks.check import Check
from grader.nearest import did_you_mean

FAMILIES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "package": ("package", "dependency"),
        "interface": ("interface",),
        "source": ("source",),
        "node": ("node",),
        "topic": ("topic", "untouched"),
        "qos": ("qos", "peer", "late_joiner"),
        "messages": ("messages", "following", "sequence"),
        "timing": ("timing", "rate", "latency"),
        "executor": ("executor", "timer"),
        "callbacks": ("callbacks", "overlap", "together"),
        "service": ("service",),
        "action": ("action", "action_end"),
        "parameter": ("parameter", "parameter_effect"),
        "lifecycle": ("lifecycle",),
        "log": ("log", "log_content"),
        "motion": (
            "drive",
            "straight",
            "stop",
            "contact",
            "goal",
            "turning",
            "proportional",
            "limits",
            "slowing",
        ),
        "rotation": ("rotation",),
    }
)
"""First part of the names of checks -> modules of this package that define them."""


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


@cache
def _family(family: str) -> Mapping[str, Check]:
    modules = FAMILIES.get(family, ())
    return gather(import_module(f"grader.checks.{module}") for module in modules)


class _Catalogue(Mapping[str, Check]):
    """Imports a family when one of its checks is asked for: numpy alone takes 0.1 s."""

    def __getitem__(self, name: str) -> Check:
        return _family(name.partition(".")[0])[name]

    def __iter__(self) -> Iterator[str]:
        for family in FAMILIES:
            yield from _family(family)

    def __len__(self) -> int:
        return sum(1 for _ in self)


CATALOGUE: Mapping[str, Check] = _Catalogue()


def get(name: str) -> Check:
    """The check of a name.

    Raises:
        ValueError: There is none; the message names the nearest.
    """
    try:
        return CATALOGUE[name]
    except KeyError:
        text = f"unknown check {name!r}." + did_you_mean(name, CATALOGUE)
        if "Did you mean" not in text:
            text += f" There are: {', '.join(sorted(CATALOGUE))}."
        raise ValueError(text) from None
