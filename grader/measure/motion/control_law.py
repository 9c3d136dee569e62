"""Which law a series of commands follows: in proportion to the error, or what else."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, auto

# A slow timer and a large gain leave few commands between the clamp and the goal.
_LEAST_FIT = 3
_FEW_TURNS = 5
_ZERO_RAD_S = 1e-4
# Near zero the command may pause, near half a turn both senses are right.
_PAUSE_RAD = 0.15
_EITHER_WAY_RAD = 0.3
# An error that needs no turn, and one from which the law cannot be seen.
_SMALL_RAD = 0.1
_TINY_RAD = 0.02
_SLOW_RAD_S = 0.2
_MOST_SIZES = 4
_SAME = 1e-6
_PLATEAU = 3
_FEW_WRONG = 0.05
_LEAST_TRIMMED = 8
_SHORT_OF = 0.8


@dataclass(frozen=True, slots=True)
class Sample:
    """A command and the error that it answers."""

    error_rad: float
    command_rad_s: float

    @property
    def is_turning(self) -> bool:
        """Whether it asks for a turn."""
        return abs(self.command_rad_s) > _ZERO_RAD_S

    @property
    def is_away(self) -> bool:
        """Whether it turns away from the error."""
        return self.error_rad * self.command_rad_s < 0.0

    @property
    def is_wrong(self) -> bool:
        """Whether it clearly turns away from the error."""
        size = abs(self.error_rad)
        return _PAUSE_RAD < size < math.pi - _EITHER_WAY_RAD and self.is_turning and self.is_away

    def full_turn_off(self) -> Sample:
        """The same command for the error with the other sign, a full turn off."""
        other_rad = self.error_rad - math.copysign(math.tau, self.error_rad)
        return Sample(other_rad, self.command_rad_s)


class Law(Enum):
    """What the commands follow."""

    PROPORTIONAL = auto()
    """A line through the origin describes them best, well or badly."""
    NOTHING_TO_DO = auto()
    """There was hardly an error, and hardly a command."""
    TOO_FEW = auto()
    ZERO = auto()
    STEPS = auto()
    NOT_NORMALISED = auto()
    WRONG_SIGN = auto()


@dataclass(frozen=True)
class LawVerdict:
    """A law with its figures.

    Attributes:
        gain: Slope of the line through the origin, in rad/s for each rad.
        r2: Coefficient of determination of that line, at most 1.
        values: For steps: the sizes of the commands, in rad/s.
        share: For an error that is not normalised: share of the commands that are a turn off.
    """

    law: Law
    gain: float = 0.0
    r2: float = 0.0
    used: int = 0
    values: tuple[float, ...] = ()
    share: float = 0.0


def examine(samples: Sequence[Sample], limit_rad_s: float, least_r2: float) -> LawVerdict:
    """Find the law behind commands.

    Args:
        samples: In the order of time; finite.
        limit_rad_s: What the robot can do; larger commands say little of the law.
    """
    turning = [item for item in samples if item.is_turning]
    largest_rad = max((abs(item.error_rad) for item in samples), default=math.inf)
    fastest_rad_s = max((abs(item.command_rad_s) for item in samples), default=0.0)
    if (largest_rad <= _SMALL_RAD and len(turning) < _FEW_TURNS) or (
        largest_rad <= _TINY_RAD and fastest_rad_s <= _SLOW_RAD_S
    ):
        return LawVerdict(Law.NOTHING_TO_DO, used=len(samples))
    if len(samples) < _LEAST_FIT:
        return LawVerdict(Law.TOO_FEW, used=len(samples))
    if not turning:
        return LawVerdict(Law.ZERO, used=len(samples))
    steps = _steps(turning)
    if steps:
        return LawVerdict(Law.STEPS, used=len(turning), values=steps)
    # Near half a turn the error may be read with either sign: take that of the command.
    judged = [
        item.full_turn_off()
        if abs(item.error_rad) > math.pi - _EITHER_WAY_RAD and item.is_away
        else item
        for item in samples
        if item.is_turning or abs(item.error_rad) > _PAUSE_RAD
    ]
    wrong = sum(item.is_wrong for item in judged) / len(judged)
    best = fit(judged, limit_rad_s)
    if wrong <= _FEW_WRONG:
        return best
    turned = fit([one.full_turn_off() if one.is_wrong else one for one in judged], limit_rad_s)
    mirrored = fit([Sample(-one.error_rad, one.command_rad_s) for one in judged], limit_rad_s)
    if turned.gain > 0.0 and turned.r2 >= max(0.8 * least_r2, mirrored.r2):
        return LawVerdict(Law.NOT_NORMALISED, turned.gain, turned.r2, turned.used, share=wrong)
    if mirrored.gain > 0.0 and wrong > 0.5:
        return LawVerdict(Law.WRONG_SIGN, -mirrored.gain, mirrored.r2, mirrored.used)
    # The line of those that turn the right way, with no merit for the others.
    return LawVerdict(Law.PROPORTIONAL, best.gain, min(best.r2, 1.0 - wrong - least_r2), best.used)


def _steps(turning: Sequence[Sample]) -> tuple[float, ...]:
    """The few sizes that all commands have, or nothing where they have many.

    A clamp gives the largest size again and again; below it a line has every size once.
    """
    sizes = [float(f"{abs(item.command_rad_s):.3g}") for item in turning]
    distinct = tuple(sorted(set(sizes)))
    below = sum(size < distinct[-1] for size in sizes)
    few = len(distinct) <= _MOST_SIZES and len(sizes) > 2 * len(distinct)
    return distinct if few and (not below or below > 2 * (len(distinct) - 1)) else ()


def fit(samples: Sequence[Sample], limit_rad_s: float) -> LawVerdict:
    """Lay a line through the origin and the commands that are at no limit.

    A command at a limit is left out only if the line asks for at least that much there, so that
    a step does not pass for a clamp.
    """
    if not samples:
        return LawVerdict(Law.TOO_FEW)
    sizes = [abs(item.command_rad_s) for item in samples]
    highest = max(sizes)
    lowest = min((size for size in sizes if size > _ZERO_RAD_S), default=0.0)
    clamp = highest if _count(sizes, highest) >= _PLATEAU else math.inf
    floor = lowest if _count(sizes, lowest) >= _PLATEAU and lowest < highest else 0.0
    clamp = min(clamp, limit_rad_s * 0.999)
    high, low = clamp * (1.0 - _SAME), floor * (1.0 + _SAME)
    inside = [item for item in samples if low < abs(item.command_rad_s) < high]
    if len(inside) < _LEAST_FIT:
        # Without a clamp of its own the law shows in what was asked for beyond the limit too.
        inside, high, low = list(samples), math.inf, 0.0
    slope = _gain(inside)

    def counts(item: Sample) -> bool:
        size, wanted = abs(item.command_rad_s), slope * abs(item.error_rad)
        if size >= high:
            return wanted < _SHORT_OF * clamp
        return size > low or wanted > floor / _SHORT_OF

    kept = _without_strays([item for item in samples if counts(item)])
    gain = _gain(kept)
    return LawVerdict(Law.PROPORTIONAL, gain, _r2(kept, gain), len(kept))


def _without_strays(samples: list[Sample]) -> list[Sample]:
    """Leave out the few commands that fit worst.

    Where one phase ends and the next begins, a command or two answer the error of the other.
    """
    if len(samples) < _LEAST_TRIMMED:
        return samples
    gain = _gain(samples)
    by_rest = sorted(samples, key=lambda item: abs(item.command_rad_s - gain * item.error_rad))
    return by_rest[: len(samples) - math.ceil(_FEW_WRONG * len(samples))]


def _count(sizes: Sequence[float], size: float) -> int:
    return sum(math.isclose(item, size, rel_tol=_SAME) for item in sizes)


def _gain(samples: Sequence[Sample]) -> float:
    square = sum(item.error_rad**2 for item in samples)
    product = sum(item.error_rad * item.command_rad_s for item in samples)
    return product / square if square > 0.0 else 0.0


def _r2(samples: Sequence[Sample], gain: float) -> float:
    # In shares of the largest command, so that the squares of huge ones are still numbers.
    largest = max(abs(item.command_rad_s) for item in samples) or 1.0
    shares = [item.command_rad_s / largest for item in samples]
    mean = sum(shares) / len(samples)
    total = sum((share - mean) ** 2 for share in shares)
    rest = sum(
        (share - gain / largest * item.error_rad) ** 2
        for share, item in zip(shares, samples, strict=True)
    )
    if total <= 0.0:
        return 1.0 if rest <= 0.0 else 0.0
    return 1.0 - rest / total
