"""The motion of a robot from poses: of a simulator of the author's, or of odometry in a bag."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from operator import itemgetter
from typing import TypeVar

from grader.recording.simulated import Truth
from sim.motion import NS, REST, Pose, Twist, wrap_angle

STEP_NS = 10_000_000
"""As of rosgrade's own simulator, which checks are made for."""
_HALF_WINDOW_NS = 50_000_000
"""Velocities are means over this time before and after: times and poses of a simulator jitter."""
_LATE_NS = NS
"""Time without news after which simulated time counts as standing still."""
CONTACT = "contact"
_Value = TypeVar("_Value")


@dataclass(frozen=True)
class Sighting:
    """A pose as it was published.

    Attributes:
        time_ns: When, by the clock of the machine.
        stamp_ns: The same in simulated time, or ``time_ns`` where the message has no stamp.
    """

    time_ns: int
    stamp_ns: int
    pose: Pose


def velocities(seen: Sequence[Sighting]) -> list[Twist]:
    """The velocity at each sighting, in simulated time; forward is positive."""
    times = [one.time_ns for one in seen]
    found: list[Twist] = []
    for index, one in enumerate(seen):
        first = min(bisect_left(times, one.time_ns - _HALF_WINDOW_NS), max(index - 1, 0))
        last = max(bisect_right(times, one.time_ns + _HALF_WINDOW_NS) - 1, index + 1)
        path = seen[first : last + 1]
        before, after = path[0], path[-1]
        lasts_s = (after.stamp_ns - before.stamp_ns) / NS
        if lasts_s <= 0.0:
            found.append(found[-1] if found else REST)
            continue
        ahead_m = (after.pose.x_m - before.pose.x_m) * math.cos(one.pose.yaw_rad)
        ahead_m += (after.pose.y_m - before.pose.y_m) * math.sin(one.pose.yaw_rad)
        turned = sum(wrap_angle(b.pose.yaw_rad - a.pose.yaw_rad) for a, b in pairwise(path))
        found.append(Twist(ahead_m / lasts_s, turned / lasts_s))
    return found


def truth_of(
    seen: Sequence[Sighting],
    commands: Sequence[tuple[int, Twist]],
    contacts: Sequence[tuple[int, bool]] = (),
    twists: Sequence[Twist] = (),
) -> tuple[Truth, ...]:
    """Steps between the first and the last sighting; the robot goes straight between two.

    Args:
        seen: Oldest first, at different times.
        commands: Times and what is commanded from then on, oldest first.
        contacts: Times and whether the robot touches something from then on, oldest first.
        twists: The velocity at each sighting; by default what follows from the poses.
    """
    found = []
    for (before, after), twist in zip(pairwise(seen), twists or velocities(seen), strict=False):
        for time_ns in range(before.time_ns, after.time_ns, STEP_NS):
            share = (time_ns - before.time_ns) / (after.time_ns - before.time_ns)
            start, end = before.pose, after.pose
            command = _value_at(commands, time_ns, REST)
            touches = _value_at(contacts, time_ns, False)
            found.append(
                Truth(
                    time_ns,
                    start.x_m + share * (end.x_m - start.x_m),
                    start.y_m + share * (end.y_m - start.y_m),
                    wrap_angle(start.yaw_rad + share * wrap_angle(end.yaw_rad - start.yaw_rad)),
                    linear_m_s=twist.linear_m_s,
                    angular_rad_s=twist.angular_rad_s,
                    command_m_s=command.linear_m_s,
                    command_rad_s=command.angular_rad_s,
                    contact=CONTACT if touches else None,
                )
            )
    return tuple(found)


def _value_at(changes: Sequence[tuple[int, _Value]], time_ns: int, first: _Value) -> _Value:
    """The value of the last change by a time; the first value before any change."""
    index = bisect_right(changes, time_ns, key=itemgetter(0))
    return changes[index - 1][1] if index else first


class RealTimeFactor:
    """How fast simulated time runs, over the last seconds: 1 is as fast as real time."""

    def __init__(self, window_s: float) -> None:
        self._window_ns = round(window_s * NS)
        self._seen: deque[tuple[int, int]] = deque()

    def note(self, time_ns: int, simulated_ns: int) -> None:
        """Note a reading of the simulated clock."""
        self._seen.append((time_ns, simulated_ns))
        while len(self._seen) > 2 and self._seen[1][0] <= time_ns - self._window_ns:
            self._seen.popleft()

    def now(self, time_ns: int) -> float | None:
        """The factor at a time, or None as long as too little was seen."""
        if not self._seen:
            return None
        (begin_ns, from_ns), (end_ns, to_ns) = self._seen[0], self._seen[-1]
        if time_ns - end_ns > _LATE_NS:
            end_ns = time_ns
        lasts_ns = end_ns - begin_ns
        return (to_ns - from_ns) / lasts_ns if lasts_ns >= self._window_ns else None
