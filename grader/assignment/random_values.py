"""Values of a scenario, fixed or drawn from its seed, put in the place of ``$name``."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING, Any

from grader.errors import UsageError
from grader.spec.nearest_name import did_you_mean
from grader.spec.unit import parse_any, shown_in

if TYPE_CHECKING:
    from grader.assignment.model import Scenario

_DECIMALS = 3


def fixed_values(scenario: Scenario) -> dict[str, float]:
    """The values of a scenario that are the same in every run, in SI units."""
    return {name: fixed.number for name, fixed in scenario.values.items()}


def draw_values(scenario: Scenario, seed: int) -> dict[str, float]:
    """The values of a run of a scenario, in SI units: the fixed ones, and the random ones drawn."""
    drawn = {
        name: round(random.Random(f"{seed}/{name}").uniform(bounds.low, bounds.high), _DECIMALS)
        for name, bounds in scenario.random.items()
    }
    return {**fixed_values(scenario), **drawn}


def world_values(scenario: Scenario, values: dict[str, float]) -> dict[str, str]:
    """The values as a world file wants them: with their unit."""
    units = {name: bounds.unit for name, bounds in scenario.random.items()}
    units |= {name: fixed.unit for name, fixed in scenario.values.items()}
    return {
        name: f"{shown_in(value, units[name])!r} {units[name]}".strip()
        for name, value in values.items()
    }


def fill_in(value: Any, values: dict[str, float]) -> Any:
    """A launch parameter with ``$name`` and quantities replaced by numbers in SI units."""
    if isinstance(value, list):
        return [fill_in(item, values) for item in value]
    if not isinstance(value, str):
        return value
    if value.startswith("$"):
        name = value[1:]
        if name not in values:
            raise UsageError(f"there is no value {name!r}." + did_you_mean(name, values))
        return values[name]
    try:
        number, unit = parse_any(value)
    except ValueError:
        return value
    return number if unit else value
