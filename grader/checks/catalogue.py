"""The catalogue of checks: every check by its name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType, ModuleType

from grader.checks import (
    action,
    action_end,
    callbacks,
    contact,
    dependency,
    drive,
    executor,
    following,
    goal,
    interface,
    late_joiner,
    latency,
    lifecycle,
    limits,
    log,
    log_content,
    messages,
    node,
    overlap,
    package,
    parameter,
    parameter_effect,
    peer,
    proportional,
    qos,
    rate,
    rotation,
    sequence,
    service,
    slowing,
    source,
    stop,
    straight,
    timing,
    together,
    topic,
    turning,
    untouched,
)
from grader.checks.check import Check
from grader.nearest import did_you_mean

FAMILIES: tuple[ModuleType, ...] = (
    package,
    dependency,
    interface,
    source,
    node,
    topic,
    qos,
    peer,
    late_joiner,
    messages,
    following,
    sequence,
    timing,
    rate,
    latency,
    executor,
    callbacks,
    overlap,
    together,
    service,
    action,
    action_end,
    parameter,
    parameter_effect,
    lifecycle,
    log,
    log_content,
    drive,
    straight,
    stop,
    contact,
    goal,
    turning,
    proportional,
    limits,
    slowing,
    untouched,
    rotation,
)


def gather(families: Iterable[ModuleType]) -> Mapping[str, Check]:
    """Collect the checks that are defined in modules, in the order of their definition.

    Raises:
        ValueError: Two checks have the same name.
    """
    found: dict[str, Check] = {}
    for family in families:
        for item in vars(family).values():
            if not isinstance(item, Check):
                continue
            if item.name in found:
                raise ValueError(f"two checks are called {item.name!r}")
            found[item.name] = item
    return MappingProxyType(found)


CATALOGUE: Mapping[str, Check] = gather(FAMILIES)


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
