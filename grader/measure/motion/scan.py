"""What the LiDAR told the student: the recorded scans, and the classic ways to misread them."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass

from grader.checks.wording import code
from grader.measure.motion import ground
from grader.measure.motion.command import number, scans
from grader.measure.motion.ground import Sight
from grader.measure.motion.quantities import metres, side
from grader.recording.model import NS, Message, Recording
from grader.recording.simulated import Truth

_CONE_RAD = math.radians(20.0)
# What the robot drove on with for longer than this is not what stopped it: a filter of some
# scans and a slow timer have decided by then.
_DECIDED_NS = NS
# Every so many steps of the simulator are looked at.
_STRIDE = 10


@dataclass(frozen=True)
class Misreading:
    """What may have been read wrongly in a scan."""

    words: str
    hint: str


def newest(recording: Recording, time_ns: int) -> Message | None:
    """The last scan that was published by a time."""
    told = scans(recording)
    index = bisect_right(told, time_ns, key=_stamp_ns)
    return told[index - 1] if index else None


def front(scan: Message, lidar_rad: float = 0.0) -> float | None:
    """What the beam straight ahead reports, in metres; may be inf, NaN or 0.0.

    Args:
        lidar_rad: How far the LiDAR is turned on the robot, counter-clockwise.
    """
    ranges = scan.value.get("ranges")
    start, step = number(scan.value, "angle_min"), number(scan.value, "angle_increment")
    if not isinstance(ranges, list | tuple) or not ranges or start is None or not step:
        return None
    return float(ranges[round((-start - lidar_rad) / step) % len(ranges)])


def misreading(recording: Recording, time_ns: int, nearest: Sight | None) -> Misreading | None:
    """Why the robot may have seen an obstacle ahead where there is none."""
    scan = newest(recording, time_ns)
    if scan is None:
        return None
    turned_rad = 0.0 if recording.scene is None else recording.scene.lidar.yaw_rad
    seen = front(scan, turned_rad)
    beside = _beside(recording, scan, time_ns, nearest)

    def reported_zero(step: Truth) -> bool:
        before = newest(recording, step.time_ns)
        return before is not None and front(before, turned_rad) == 0.0

    # Before the nearest of all: where a beam is 0.0, so is min(ranges).
    if seen == 0.0 and not _drove_on(recording, time_ns, reported_zero):
        return Misreading(
            "the beam straight ahead reported 0.0 then, which means that nothing came back",
            "A range below range_min is no obstacle: ignore ranges outside of range_min to "
            "range_max." + (f" {beside.hint}" if beside else ""),
        )
    if beside is not None:
        return beside
    if seen is not None and not math.isfinite(seen):
        return Misreading(
            f"the beam straight ahead reported {seen:g} then: nothing within its range",
            "inf is a normal range: nothing is there, so drive on. Every comparison with nan is "
            "false.",
        )
    return None


def _beside(
    recording: Recording, scan: Message, time_ns: int, nearest: Sight | None
) -> Misreading | None:
    """Whether something beside the robot, nearer than anything before, may have stopped it."""
    range_max_m = number(scan.value, "range_max") or math.inf
    if nearest is None or abs(nearest.bearing_rad) <= _CONE_RAD or nearest.distance_m > range_max_m:
        return None
    scene = recording.scene

    def as_near(step: Truth) -> bool:
        sight = None if scene is None else ground.nearest(scene, step)
        return sight is not None and sight.distance_m <= nearest.distance_m

    if _drove_on(recording, time_ns, as_near):
        return None
    return Misreading(
        f"the nearest thing, {code(nearest.name)}, was then {metres(nearest.distance_m)} away, "
        f"{side(nearest.bearing_rad)}",
        "Which range does the callback compare? min(ranges) is the nearest one anywhere. The beam "
        "straight ahead has the index round(-angle_min / angle_increment).",
    )


def _drove_on(recording: Recording, time_ns: int, seen: Callable[[Truth], bool]) -> bool:
    """Whether the robot was told to drive on long before, although it saw the same then."""
    return any(
        step.command_m_s > 0.0 and seen(step)
        for step in recording.truth[::_STRIDE]
        if step.time_ns < time_ns - _DECIDED_NS
    )


def _stamp_ns(message: Message) -> int:
    return message.stamp_ns
