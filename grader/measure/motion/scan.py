"""What the LiDAR reported to the student, and the classic ways to misread it."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from typing import NamedTuple

from grader.findings.words import metres, side
from grader.measure.motion.command import number, scans
from grader.measure.motion.ground import nearest, nearest_m
from grader.recording.model import NS, Message, Recording
from grader.recording.simulated import Truth

_CONE_RAD = math.radians(20.0)
# What the robot drove on with for longer than this is not what stopped it: a filter of some
# scans and a slow timer have decided by then.
_DECIDED_NS = NS
# Of the steps of 10 ms: a tenth of a second is between two scans anyway.
_STRIDE = 10


class Misreading(NamedTuple):
    """What may have been read wrongly in a scan, and what to try."""

    words: str
    hint: str


def newest(recording: Recording, time_ns: int) -> Message | None:
    """The last scan that was published by a time."""
    received = scans(recording)
    index = bisect_right(received, time_ns, key=lambda message: message.stamp_ns)
    return received[index - 1] if index else None


def misreading(recording: Recording, step: Truth) -> Misreading | None:
    """Why the robot may have seen an obstacle ahead at a step where there is none."""
    scan = newest(recording, step.time_ns)
    if scan is None:
        return None
    ahead_m = front(recording, scan)

    def is_zero_ahead(earlier: Truth) -> bool:
        return front(recording, newest(recording, earlier.time_ns)) == 0.0

    # Before the nearest of all: where a beam is 0.0, so is min(ranges).
    if ahead_m == 0.0 and not _drove_on(recording, step, is_zero_ahead):
        return Misreading(
            "the beam straight ahead reported 0.0 then, which means that nothing came back",
            "A range below range_min is no obstacle: ignore ranges outside of range_min to "
            "range_max.",
        )
    beside = _beside(recording, scan, step)
    if beside is None and ahead_m is not None and not math.isfinite(ahead_m):
        return Misreading(
            f"the beam straight ahead reported {ahead_m:g} then: nothing within its range",
            "inf is a normal range: nothing is there, so drive on. Every comparison with nan is "
            "false.",
        )
    return beside


def front(recording: Recording, scan: Message | None) -> float | None:
    """What the beam straight ahead reports, in metres; may be inf, NaN or 0.0."""
    if scan is None:
        return None
    ranges = scan.value.get("ranges")
    start, increment = number(scan.value, "angle_min"), number(scan.value, "angle_increment")
    if not isinstance(ranges, list | tuple) or not ranges or start is None or not increment:
        return None
    turned_rad = 0.0 if recording.scene is None else recording.scene.lidar.yaw_rad
    return float(ranges[round((-start - turned_rad) / increment) % len(ranges)])


def _beside(recording: Recording, scan: Message, step: Truth) -> Misreading | None:
    """Whether something beside the robot, nearer than anything before, may have stopped it."""
    scene = recording.scene
    near = None if scene is None else nearest(scene, step)
    range_max_m = number(scan.value, "range_max") or math.inf
    if scene is None or near is None or near.distance_m > range_max_m:
        return None

    def is_as_near(earlier: Truth) -> bool:
        distance_m = nearest_m(scene, earlier)
        return distance_m is not None and distance_m <= near.distance_m

    if abs(near.bearing_rad) <= _CONE_RAD or _drove_on(recording, step, is_as_near):
        return None
    return Misreading(
        f"the nearest thing, {near.name}, was then {metres(near.distance_m)} away, "
        f"{side(near.bearing_rad)}",
        "Which range does the callback compare? min(ranges) is the nearest one anywhere. The beam "
        "straight ahead has the index round(-angle_min / angle_increment).",
    )


def _drove_on(recording: Recording, at: Truth, seen: Callable[[Truth], bool]) -> bool:
    """Whether the robot was commanded to drive on long before, although it saw the same then."""
    return any(
        step.command_m_s > 0.0 and seen(step)
        for step in recording.truth[::_STRIDE]
        if step.time_ns < at.time_ns - _DECIDED_NS
    )
