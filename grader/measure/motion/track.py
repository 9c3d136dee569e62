"""The way of the simulated robot, read from its ground truth."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from itertools import pairwise

from grader.findings.finding import Plot
from grader.recording.model import NS, Recording
from grader.recording.simulated import Truth
from sim.motion import Pose, wrap_angle

REST_M_S = 1e-3
REST_RAD_S = 1e-3
MOVED_M = 1e-3
MOVED_RAD = 1e-2
STRIDE = 5
"""What stands or lies around the robot is looked at every 50 ms: often enough, and five times as
fast as at each step of 10 ms."""
# A pause shorter than this is no rest: on-off driving rests again and again.
_REST_NS = NS // 2
_MOST_POINTS = 400


def is_at_rest(step: Truth) -> bool:
    """Whether the robot neither drives nor turns."""
    return abs(step.linear_m_s) < REST_M_S and abs(step.angular_rad_s) < REST_RAD_S


def has_moved(truth: Sequence[Truth]) -> bool:
    """Whether the robot has left its place or its heading at any time."""
    if not truth:
        return False
    first = truth[0]
    return any(
        math.hypot(step.x_m - first.x_m, step.y_m - first.y_m) > MOVED_M
        or abs(wrap_angle(step.yaw_rad - first.yaw_rad)) > MOVED_RAD
        for step in truth
    )


def way_m(truth: Sequence[Truth]) -> float:
    """Length of the path."""
    return sum(math.hypot(b.x_m - a.x_m, b.y_m - a.y_m) for a, b in pairwise(truth))


def gone_ahead_m(truth: Sequence[Truth]) -> float:
    """Way that was driven ahead, less what was driven backwards."""
    return sum(
        math.copysign(math.hypot(b.x_m - a.x_m, b.y_m - a.y_m), b.linear_m_s)
        for a, b in pairwise(truth)
    )


def turned_rad(truth: Sequence[Truth]) -> float:
    """Net turn along the path, counter-clockwise, full turns counted."""
    return sum(wrap_angle(b.yaw_rad - a.yaw_rad) for a, b in pairwise(truth))


def departure(truth: Sequence[Truth]) -> int | None:
    """Index of the first step in which the robot moves, or None."""
    return next((index for index, step in enumerate(truth) if not is_at_rest(step)), None)


def first_rest(truth: Sequence[Truth]) -> int | None:
    """Index of the first step of a rest after it had moved, or None.

    A rest lasts for half a second, or until the end.
    """
    begin = departure(truth)
    if begin is None:
        return None
    since: int | None = None
    for index in range(begin, len(truth)):
        if not is_at_rest(truth[index]):
            since = None
        elif since is None:
            since = index
        elif truth[index].time_ns - truth[since].time_ns >= _REST_NS:
            return since
    return since


def final_rest(truth: Sequence[Truth]) -> int | None:
    """Index of the first step of the rest that lasts until the end, or None."""
    index = len(truth)
    while index and is_at_rest(truth[index - 1]):
        index -= 1
    return index if index < len(truth) else None


def index_at(truth: Sequence[Truth], time_ns: int) -> int:
    """Index of the last step that had ended at a time; the first where none had."""
    return max(0, bisect_right(truth, time_ns, key=_time_ns) - 1)


def pose_at(truth: Sequence[Truth], time_ns: int) -> Pose:
    """True pose at a time, interpolated; before the first and after the last step, their poses."""
    index = bisect_left(truth, time_ns, key=_time_ns)
    if index == 0 or index == len(truth):
        step = truth[min(index, len(truth) - 1)]
        return Pose(step.x_m, step.y_m, step.yaw_rad)
    before, after = truth[index - 1], truth[index]
    share = (time_ns - before.time_ns) / (after.time_ns - before.time_ns)
    return Pose(
        before.x_m + share * (after.x_m - before.x_m),
        before.y_m + share * (after.y_m - before.y_m),
        wrap_angle(before.yaw_rad + share * wrap_angle(after.yaw_rad - before.yaw_rad)),
    )


def over_time(
    recording: Recording,
    title: str,
    y_label: str,
    value: Callable[[Truth], float | None],
    band: tuple[float, float] | None = None,
) -> Plot:
    """Draw a value of each step over time, with its allowed band; None leaves a step out."""
    truth = recording.truth
    stride = max(1, len(truth) // _MOST_POINTS)
    x, y = [], []
    for step in truth[::stride]:
        y_value = value(step)
        if y_value is not None:
            x.append(recording.since_launch_s(step.time_ns))
            y.append(y_value)
    return Plot(title, "time since launch (s)", y_label, tuple(x), tuple(y), band)


def speed_plot(recording: Recording, band: tuple[float, float] | None = None) -> Plot:
    """The true speed over time."""
    return over_time(recording, "True speed", "speed (m/s)", lambda step: step.linear_m_s, band)


def _time_ns(step: Truth) -> int:
    return step.time_ns
