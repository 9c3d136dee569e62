"""Points: the one place where they are rounded.

A passed check has its full points, exactly as the author wrote them. Partial credit is
rounded half up to a hundredth of a point, and stays at least a hundredth below the full
points, so that only a submission that passes everything has the full score. Sums are made of
exact decimals and never rounded: 0.1 + 0.2 is 0.3.
"""

from __future__ import annotations

from collections.abc import Iterable
from decimal import ROUND_HALF_UP, Decimal

STEP = Decimal("0.01")


def points_for(max_points: float, credit: float) -> float:
    """Points of one check.

    Args:
        max_points: Points for passing, at least 0.
        credit: Share in [0, 1]; only a passed check has 1.

    Returns:
        Points in [0, max_points].
    """
    if credit >= 1.0:
        return max_points
    full = _exact(max_points)
    earned = (full * _exact(credit)).quantize(STEP, ROUND_HALF_UP)
    return float(max(Decimal(0), min(earned, full - STEP)))


def total(points: Iterable[float]) -> float:
    """Sum without the errors of binary fractions."""
    return float(sum((_exact(value) for value in points), Decimal(0)))


def _exact(value: float) -> Decimal:
    return Decimal(repr(float(value)))
