"""Wheel odometry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.description import OdometryOptions
from sim.motion import REST, Pose, Twist, relative
from sim.odometry import WheelOdometry

SEPARATION_M = 0.16


def odometry(start: Pose, seed: int = 0, **options: object) -> WheelOdometry:
    read = OdometryOptions.model_validate(options)
    return WheelOdometry(read, start, SEPARATION_M, np.random.default_rng(seed))


def test_without_drift_it_is_the_truth_to_the_last_bit() -> None:
    wheels = odometry(Pose(1.0, 2.0, 0.5))
    pose, twist = Pose(0.1, 0.2, 0.3), Twist(0.4, 0.5)
    sample = wheels.sample(7, pose, twist)
    assert (sample.time_ns, sample.pose, sample.twist) == (7, pose, twist)


@given(
    st.builds(Pose, st.floats(-5, 5), st.floats(-5, 5), st.floats(-3, 3)),
    st.builds(Pose, st.floats(-5, 5), st.floats(-5, 5), st.floats(-3, 3)),
)
def test_from_the_start_it_is_the_truth_as_seen_from_the_start(start: Pose, pose: Pose) -> None:
    sample = odometry(start, origin="start").sample(0, pose, REST)
    assert sample.pose == relative(start, pose)
    assert odometry(start, origin="start").sample(0, start, REST).pose == Pose(0.0, 0.0, 0.0)


def believed(wheels: WheelOdometry, ways: list[tuple[float, float]]) -> Pose:
    for way_m, turn_rad in ways:
        wheels.move(way_m, turn_rad)
    return wheels.sample(0, Pose(99.0, 99.0, 0.0), REST).pose


def test_unequal_wheels_bend_a_straight_way() -> None:
    """The turn after a way s is s (right - left) / separation, the errors drawn from the seed."""
    errors = np.random.default_rng(3).standard_normal(3)
    pose = believed(odometry(Pose(0.0, 0.0, 0.0), 3, drift={"radius": "1 %"}), [(0.01, 0.0)] * 100)
    turn = 1.0 * 0.01 * (errors[1] - errors[0]) / SEPARATION_M
    assert pose.yaw_rad == pytest.approx(turn)


def test_a_wrong_separation_scales_turns() -> None:
    errors = np.random.default_rng(4).standard_normal(3)
    wheels = odometry(Pose(0.0, 0.0, 0.0), 4, drift={"separation": "5 %"})
    pose = believed(wheels, [(0.0, 0.01)] * 100)
    assert pose.yaw_rad == pytest.approx(1.0 / (1.0 + 0.05 * errors[2]))


def test_wheel_slip_grows_with_the_square_root_of_the_way() -> None:
    ends = [
        believed(odometry(Pose(0.0, 0.0, 0.0), seed, drift={"slip": "10 mm"}), [(0.04, 0.0)] * 100)
        for seed in range(300)
    ]
    # Two wheels after 4 m: each 20 mm, so the turn is 20 mm * sqrt(2) / separation.
    expected = 0.02 * math.sqrt(2.0) / SEPARATION_M
    assert np.std([end.yaw_rad for end in ends]) == pytest.approx(expected, rel=0.15)


def test_drift_comes_from_the_seed() -> None:
    ways = [(0.01, 0.005)] * 50
    options = {"drift": {"radius": "1 %", "slip": "1 mm"}}
    first = believed(odometry(Pose(0.0, 0.0, 0.0), 5, **options), ways)
    assert believed(odometry(Pose(0.0, 0.0, 0.0), 5, **options), ways) == first
    assert believed(odometry(Pose(0.0, 0.0, 0.0), 6, **options), ways) != first
