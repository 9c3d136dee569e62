"""What a student is told of checks that are not shown yet: how many, and what they are worth."""

from __future__ import annotations

from dataclasses import dataclass

from grader.assignment.model import Visibility

SHOWN_FROM = tuple(Visibility)
"""Earliest first; the order in which students get to see checks."""


@dataclass(frozen=True)
class Withheld:
    """Checks that are left out, and nothing else about them."""

    checks: int = 0
    points: float = 0.0

    def __add__(self, other: Withheld) -> Withheld:
        """Both together."""
        return Withheld(self.checks + other.checks, self.points + other.points)


NOTHING_WITHHELD = Withheld()
