"""Periods of a stream of messages: intervals, their statistics, what the host explains.

The median of the intervals is the period. An interval that differs from it by more than an allowed
amount is irregular. A message that comes late makes one interval too long and, if the next message
is in time, the following one as much too short: such a pair counts once. A pause counts for every
message that is missing in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import median

from grader.measure.numbering import is_numbered, lost
from grader.recording.model import NS, Message, Recording

# A flood is judged by its beginning, which keeps a regrade fast.
MOST_INTERVALS = 2000
# Float noise of seconds made from nanoseconds.
_EPSILON_S = 1e-9


@dataclass(frozen=True)
class Interval:
    """Time between two messages that one writer published one after the other.

    Attributes:
        before_ns: Where the interval before began, or ``begin_ns`` for the first.
    """

    begin_ns: int
    end_ns: int
    seconds: float
    before_ns: int


@dataclass(frozen=True)
class PeriodLimits:
    """What is allowed.

    Attributes:
        outliers: Share of irregular intervals that is allowed; rounded down, but one at least
            unless it is zero.
    """

    period_s: float
    median_s: float
    spread_s: float
    outliers: float

    def allowed(self, intervals: int) -> int:
        """How many of so many intervals may be irregular."""
        return max(1, int(self.outliers * intervals)) if self.outliers > 0.0 else 0


@dataclass(frozen=True)
class PeriodVerdict:
    """How intervals compare with limits; ``irregular`` has the indices of irregular ones."""

    median_s: float
    irregular: tuple[int, ...]
    period_good: bool
    regular: bool

    @property
    def good(self) -> bool:
        """Whether both hold."""
        return self.period_good and self.regular


def intervals(messages: Sequence[Message]) -> tuple[Interval, ...]:
    """Intervals between consecutive messages by source timestamps, at most MOST_INTERVALS.

    Where the writer's sequence numbers tell that a message between two was lost on its way,
    the time between these two is no interval of the writer's, and is left out.
    """
    messages = messages[: MOST_INTERVALS + 1]
    numbered = is_numbered(messages)
    found = []
    before_ns = messages[0].stamp_ns if messages else 0
    for one, other in pairwise(messages):
        if not numbered or not lost(one, other):
            seconds = (other.stamp_ns - one.stamp_ns) / NS
            found.append(Interval(one.stamp_ns, other.stamp_ns, seconds, before_ns))
        before_ns = one.stamp_ns
    return tuple(found)


def judge(seconds: Sequence[float], limits: PeriodLimits) -> PeriodVerdict:
    """Judge intervals.

    Args:
        seconds: At least one interval, in their order.
    """
    middle = median(seconds)
    irregular = _irregular([value - middle for value in seconds], limits.spread_s + _EPSILON_S)
    # An irregular interval counts for each message that is missing in it.
    missing = [round(seconds[index] / middle) - 1 if middle > 0.0 else 1 for index in irregular]
    return PeriodVerdict(
        median_s=middle,
        irregular=irregular,
        period_good=abs(middle - limits.period_s) <= limits.median_s + _EPSILON_S,
        regular=sum(max(1, number) for number in missing) <= limits.allowed(len(seconds)),
    )


def _irregular(deviations: Sequence[float], allowed_s: float) -> tuple[int, ...]:
    """Indices of the deviations that are too large; one late message counts once."""
    found = []
    is_made_up_for = False
    for index, (deviation_s, next_s) in enumerate(pairwise([*deviations, 0.0])):
        if is_made_up_for or abs(deviation_s) <= allowed_s:
            is_made_up_for = False
            continue
        found.append(index)
        # Too long, then as much too short: one message was late.
        is_made_up_for = deviation_s > 0.0 > next_s and abs(deviation_s + next_s) <= allowed_s
    return tuple(found)


def undisturbed(recording: Recording, measured: Sequence[Interval]) -> list[float]:
    """The intervals in seconds during and before which the host took nothing."""
    return [
        item.seconds for item in measured if not recording.stolen_s(item.before_ns, item.end_ns)
    ]


def forgiven(
    recording: Recording, measured: Sequence[Interval], limits: PeriodLimits
) -> tuple[float, ...]:
    """The intervals in seconds as they could have been if the host had taken nothing.

    Each is moved towards the expected period by at most what the host took: from a long one
    what was taken during it, to a short one what was taken before it began, since then the
    message before was late.
    """
    found = []
    for item in measured:
        deviation = item.seconds - limits.period_s
        begin_ns = item.begin_ns if deviation > 0.0 else item.before_ns
        stolen_s = recording.stolen_s(begin_ns, item.end_ns)
        moved = min(abs(deviation), stolen_s)
        found.append(item.seconds - moved if deviation > 0.0 else item.seconds + moved)
    return tuple(found)
