"""When something periodic is due, in integer nanoseconds, so that no rate drifts."""

from __future__ import annotations

from fractions import Fraction

from sim.motion import NS


class Schedule:
    """A rate and how often it has been due.

    The k-th time (from 1) is due at ``k / rate`` exactly, as a fraction: 30 Hz on steps of
    10 ms comes after 40, 30, 30, 40, ... ms, 300 times in every 10 s.
    """

    def __init__(self, rate_hz: float, starts_ns: int = 0, stops_ns: int | None = None) -> None:
        """Begin at simulated time 0.

        Args:
            rate_hz: How often in a second.
            stops_ns: What is due at this time or later is left out, or None.
        """
        period = NS / Fraction(rate_hz).limit_denominator(1_000_000)
        self._numerator, self._denominator = period.numerator, period.denominator
        self._starts_ns, self._stops_ns = starts_ns, stops_ns
        self._next = 1

    def next_ns(self, step_ns: int) -> int:
        """The first multiple of ``step_ns`` at which it will be due."""
        steps = -(-self._next * self._numerator // (self._denominator * step_ns))
        return steps * step_ns

    def is_due(self, time_ns: int) -> bool:
        """Whether it is due at a time; must be asked with times that increase.

        More than one that is due since the last time counts as one.
        """
        count = time_ns * self._denominator // self._numerator
        if count < self._next:
            return False
        self._next = count + 1
        return time_ns >= self._starts_ns and (self._stops_ns is None or time_ns < self._stops_ns)
