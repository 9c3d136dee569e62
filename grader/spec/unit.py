"""Units: ``300 ms`` is read and written here, and is 0.3 s everywhere else.

Inside the program every quantity is a float in SI units (REP-103: metres, seconds,
radians); this module is the only place that knows other units.
"""

from __future__ import annotations

import math
import re
from enum import Enum


class Dimension(Enum):
    """A physical dimension, with its units as factors to SI."""

    TIME = "time"
    FREQUENCY = "frequency"
    LENGTH = "length"
    ANGLE = "angle"
    SPEED = "speed"
    ANGULAR_SPEED = "angular speed"
    ACCELERATION = "acceleration"
    ANGULAR_ACCELERATION = "angular acceleration"
    RATIO = "ratio"
    SIZE = "size"

    @property
    def phrase(self) -> str:
        """The name with its article."""
        return f"{'an' if self.value[0] in 'aeiou' else 'a'} {self.value}"


_DEGREE = math.pi / 180.0
UNITS: dict[Dimension, dict[str, float]] = {
    Dimension.TIME: {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
    Dimension.FREQUENCY: {"Hz": 1.0, "kHz": 1e3, "mHz": 1e-3},
    Dimension.LENGTH: {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "km": 1e3},
    Dimension.ANGLE: {"rad": 1.0, "deg": _DEGREE},
    Dimension.SPEED: {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3},
    Dimension.ANGULAR_SPEED: {"rad/s": 1.0, "deg/s": _DEGREE},
    Dimension.ACCELERATION: {"m/s^2": 1.0, "cm/s^2": 1e-2},
    Dimension.ANGULAR_ACCELERATION: {"rad/s^2": 1.0, "deg/s^2": _DEGREE},
    Dimension.RATIO: {"%": 1e-2},
    Dimension.SIZE: {"B": 1.0, "KiB": 2.0**10, "MiB": 2.0**20, "GiB": 2.0**30},
}

# What people write instead, in lower case.
_MISSPELT = {
    **{unit.casefold(): unit for units in UNITS.values() for unit in units if unit != "mHz"},
    **{"sec": "s", "seconds": "s", "μs": "us", "degrees": "deg", "°": "deg", "°/s": "deg/s"},
    **{"percent": "%", "m/s²": "m/s^2", "kb": "KiB", "mb": "MiB", "gb": "GiB"},
}

_NUMBER = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_QUANTITY = re.compile(rf"\s*({_NUMBER})\s*([^\s0-9:.,+-]\S*)?\s*")


def parse_quantity(text: str | int | float, dimension: Dimension) -> float:
    """Read a number and a unit such as ``"300 ms"``; a ValueError names the allowed units.

    Zero may stand without a unit, and so may a ratio below one (``0.05`` is ``5 %``).
    """
    allowed = ", ".join(UNITS[dimension])
    if isinstance(text, bool) or not isinstance(text, str | int | float):
        raise ValueError(f"expected {dimension.phrase} with a unit ({allowed})")
    match = _QUANTITY.fullmatch(str(text))
    if not match:
        what = dimension.phrase
        raise ValueError(f"{text!r} is not {what}: write a number and a unit ({allowed})")
    unit = match[2]
    value = float(match[1]) * (_factor(unit, dimension) if unit else 1.0)
    if not math.isfinite(value):
        raise ValueError(f"{text!r} is not finite")
    if not unit and value != 0.0:
        if dimension is not Dimension.RATIO:
            example = f"{match[1]} {next(iter(UNITS[dimension]))}"
            raise ValueError(f"{text!r} has no unit: write for example {example!r}")
        if abs(value) >= 1.0:
            raise ValueError(f"{text!r} has no unit: did you mean '{match[1]} %'?")
    return value


def quantity_pattern(dimension: Dimension) -> str:
    """Regular expression, in the dialect of JSON Schema, of a number with its unit."""
    units = "|".join(re.escape(unit) for unit in UNITS[dimension])
    optional = "?" if dimension is Dimension.RATIO else ""
    return rf"^\s*{_NUMBER}\s*({units}){optional}\s*$"


def write_quantity(value: float, dimension: Dimension) -> str:
    """Write a value in SI units so that :func:`parse_quantity` reads the same value again."""
    if dimension is Dimension.RATIO:
        return repr(value) if abs(value) < 1.0 else f"{value * 100.0!r} %"
    return f"{value!r} {next(iter(UNITS[dimension]))}"


def parse_any(text: str | int | float) -> tuple[float, str]:
    """Read a number with any unit, or without one.

    Returns:
        The value in SI units and the SI unit, such as ``(1.57, "rad")``; an empty unit for a
        bare number.
    """
    match = None if isinstance(text, bool) else _QUANTITY.fullmatch(str(text))
    if not match:
        raise ValueError(f"{text!r} is not a number, with or without a unit")
    if not match[2]:
        return float(match[1]), ""
    for dimension, units in UNITS.items():
        if match[2] in units:
            return parse_quantity(text, dimension), next(iter(units))
    raise ValueError(f"unknown unit {match[2]!r} in {text!r}")


def shown_in(value: float, unit: str) -> float:
    """A value in SI units as it is written before the unit that :func:`parse_any` gave."""
    return round(value * 100.0, 9) if unit in UNITS[Dimension.RATIO] else value


def _factor(unit: str, dimension: Dimension) -> float:
    units = UNITS[dimension]
    if unit in units:
        return units[unit]
    allowed = ", ".join(units)
    for other, theirs in UNITS.items():
        if unit in theirs:
            raise ValueError(
                f"{unit!r} is a unit of {other.value}, but {dimension.phrase} "
                f"is needed here ({allowed})"
            )
    meant = _MISSPELT.get(unit.casefold())
    if meant in units:
        raise ValueError(f"unknown unit {unit!r}. Did you mean {meant!r}?")
    raise ValueError(f"unknown unit {unit!r}: {dimension.phrase} has one of {allowed}")


_SHOWN_TIMES = ((1.0, "s"), (1e-3, "ms"), (1e-6, "us"), (1e-9, "ns"))


def format_duration(seconds: float) -> str:
    """Write a time for people: ``300 ms``, ``1.25 s``, ``5 min``, at most four digits."""
    size = abs(seconds)
    if size >= 300.0:
        return f"{seconds / 60.0:.4g} min"
    for factor, unit in _SHOWN_TIMES:
        if size >= factor:
            return f"{seconds / factor:.4g} {unit}"
    return f"{seconds * 1e9:.3g} ns" if size else "0 s"
