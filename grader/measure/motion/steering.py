"""Commands with the odometry that they answer, and the line through them."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from grader.measure.motion.approach import Approach
from grader.measure.motion.command import VelocityCommand, commands, number, odometry
from grader.measure.motion.track import pose_at
from grader.recording.model import NS, Message, Recording
from sim.motion import Pose

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Numbers = NDArray[Any]

MOST_BEHIND = 2
"""Messages of odometry that are on their way, or wait for a busy callback, at most."""
LEAST_FIT = 3
"""A slow timer and a large gain leave few commands between the clamp and the goal."""
ZERO_RAD_S = 1e-4
FEW_STRAYS = 0.05
# Two commands of one size, in shares of it, and how many of them show a limit.
_SAME = 1e-6
_PLATEAU = 3
# Of fewer commands none is left out as a stray.
_LEAST_TRIMMED = 8
# Share of a limit below which the line does not ask for the limit.
_SHORT_OF = 0.8


@dataclass(frozen=True)
class Answer:
    """A command with the odometry that its sender can have known: its time and true pose."""

    command: VelocityCommand
    seen_ns: int
    pose: Pose


def answers(recording: Recording, behind: int) -> list[Answer]:
    """Every finite command between the first odometry and the end.

    Args:
        behind: How many messages older than the newest the known odometry is.
    """
    received = odometry(recording)
    found = []
    for item in commands(recording):
        seen_ns = _seen_ns(received, item.time_ns, behind) if received else item.time_ns
        is_judged = item.twist.is_finite and item.time_ns <= recording.truth[-1].time_ns
        if seen_ns is not None and is_judged:
            found.append(Answer(item, seen_ns, pose_at(recording.truth, seen_ns)))
    return found


def _seen_ns(received: Sequence[Message], time_ns: int, behind: int) -> int | None:
    """Time at which the newest known odometry was measured, or None before the first."""
    index = bisect_right(received, time_ns, key=lambda message: message.stamp_ns)
    if index <= behind:
        return None
    message = received[index - 1 - behind]
    sec, nanosec = (number(message.value, "header", "stamp", key) for key in ("sec", "nanosec"))
    return message.stamp_ns if sec is None or nanosec is None else int(sec) * NS + int(nanosec)


def before_arrival(run: Approach, known: Sequence[Answer], position_m: float) -> list[Answer]:
    """Commands that answer where the robot was before it was near the goal."""
    arrival = run.arrival(position_m)
    arrival_ns = math.inf if arrival is None else run.truth[arrival].time_ns
    return [item for item in known if item.seen_ns < arrival_ns]


@dataclass(frozen=True, slots=True, order=True)
class Sample:
    """A command and the error that it answers, such as rad/s and rad, or m/s and m."""

    error: float
    command: float


@dataclass(frozen=True)
class Line:
    """A line through the origin: its slope in 1/s, and how well it fits.

    Attributes:
        r2: Coefficient of determination, at most 1.
        used: Number of commands.
    """

    gain: float
    r2: float
    used: int


def fit(samples: Sequence[Sample], limit: float) -> Line:
    """Lay a line through the origin and the commands that are at no limit.

    A command at a limit is left out only if the line asks for at least that much there, so that
    a step does not pass for a clamp. There must be a command.
    """
    import numpy as np

    errors = np.array([item.error for item in samples])
    commands = np.array([item.command for item in samples])
    kept = _between_limits(errors, commands, limit)
    errors, commands = errors[kept], commands[kept]
    if len(errors) >= _LEAST_TRIMMED:
        # Where one phase ends and the next begins, a command or two answer the error of the other.
        best_first = abs(commands - _gain(errors, commands) * errors).argsort(kind="stable")
        best = best_first[: len(errors) - math.ceil(FEW_STRAYS * len(errors))]
        errors, commands = errors[best], commands[best]
    gain = _gain(errors, commands)
    return Line(gain, _r2(errors, commands, gain), len(errors))


def _between_limits(errors: Numbers, commands: Numbers, limit: float) -> Numbers:
    """Which commands are at no limit, or ask for no more than the limit that they are at."""
    sizes = abs(commands)
    highest = sizes.max()
    lowest = sizes[sizes > ZERO_RAD_S].min(initial=highest)
    # The law has a limit of its own where its largest or smallest command comes again and again.
    clamp = highest if _count(sizes, highest) >= _PLATEAU else math.inf
    clamp = min(clamp, limit * 0.999)
    floor = lowest if _count(sizes, lowest) >= _PLATEAU and lowest < highest else 0.0
    high, low = clamp * (1.0 - _SAME), floor * (1.0 + _SAME)
    inside = (low < sizes) & (sizes < high)
    if inside.sum() < LEAST_FIT:
        # Without a clamp of its own the law shows in what was asked for beyond the limit too.
        inside, high, low = sizes >= 0.0, math.inf, 0.0
    asked = abs(errors) * _gain(errors[inside], commands[inside])
    above_floor = (sizes > low) | (asked > floor / _SHORT_OF)
    below_clamp = (sizes < high) | (asked < _SHORT_OF * clamp)
    return above_floor & below_clamp


def _count(sizes: Numbers, size: float) -> int:
    return int((abs(sizes - size) <= _SAME * size).sum())


def _gain(errors: Numbers, commands: Numbers) -> float:
    square = float(errors @ errors)
    return float(errors @ commands) / square if square > 0.0 else 0.0


def _r2(errors: Numbers, commands: Numbers, gain: float) -> float:
    # In shares of the largest command, so that the squares of huge ones are still numbers.
    largest = float(abs(commands).max(initial=0.0)) or 1.0
    shares = commands / largest
    total = float(((shares - shares.mean()) ** 2).sum())
    rest = float(((shares - gain / largest * errors) ** 2).sum())
    if total <= 0.0:
        return 1.0 if rest <= 0.0 else 0.0
    return 1.0 - rest / total
