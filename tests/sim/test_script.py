"""Obstacles on scripts."""

from __future__ import annotations

import math

import pytest

from sim.motion import NS, Pose
from sim.shapes import MovingObstacle, Waypoint


def obstacle(**changes: object) -> MovingObstacle:
    path = (
        Waypoint(1 * NS, Pose(0.0, 0.0, 0.0)),
        Waypoint(3 * NS, Pose(2.0, 4.0, 0.0)),
        Waypoint(5 * NS, Pose(0.0, 0.0, 0.0)),
    )
    return MovingObstacle(**{"label": "moving[0]", "path": path, "radius_m": 0.1, **changes})


@pytest.mark.parametrize(
    ("time_s", "x_m", "y_m"),
    [(0, 0, 0), (1, 0, 0), (1.5, 0.5, 1.0), (3, 2, 4), (4, 1, 2), (5, 0, 0), (100, 0, 0)],
)
def test_it_follows_its_waypoints_in_straight_lines(time_s: float, x_m: float, y_m: float) -> None:
    assert obstacle().pose_at(round(time_s * NS)) == Pose(x_m, y_m, 0.0)


def test_a_repeated_path_starts_over_after_its_last_waypoint() -> None:
    repeated = obstacle(repeat=True)
    for time_ns in (0, 1 * NS, 2 * NS, 4 * NS):
        later = max(time_ns, 1 * NS) + 3 * 4 * NS
        assert repeated.pose_at(later) == repeated.pose_at(max(time_ns, 1 * NS))


def test_it_is_there_from_appearing_until_before_disappearing() -> None:
    short = obstacle(appears_ns=2 * NS, disappears_ns=4 * NS)
    assert short.pose_at(2 * NS - 1) is None
    assert short.pose_at(2 * NS) is not None
    assert short.pose_at(4 * NS - 1) is not None
    assert short.pose_at(4 * NS) is None


def test_it_turns_the_short_way_round() -> None:
    path = (
        Waypoint(0, Pose(0, 0, math.radians(170))),
        Waypoint(NS, Pose(0, 0, math.radians(-170))),
    )
    turning = obstacle(path=path, radius_m=None, size_m=(1.0, 0.5))
    pose = turning.pose_at(NS // 4)
    assert pose is not None
    assert pose.yaw_rad == pytest.approx(math.radians(175))


def test_a_box_turns_with_its_pose() -> None:
    shape = obstacle(radius_m=None, size_m=(2.0, 1.0)).shape_at(Pose(0.0, 0.0, math.pi / 2))
    assert shape.contains(0.0, 0.9)
    assert not shape.contains(0.9, 0.0)
