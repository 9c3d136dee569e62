"""What is computed from poses that a simulator publishes: steps, velocities, real time factor."""

from __future__ import annotations

import math
from typing import Any

import pytest

from grader.recording.odometry import motion
from grader.recording.tracked import RealTimeFactor, Sighting, truth_of, velocities
from sim.motion import NS, Pose, Twist


def seen(
    speed: float = 0.0, turn: float = 0.0, period_s: float = 0.02, factor: float = 1.0
) -> list[Sighting]:
    """One second of a robot that drives at an even speed in simulated time."""
    found = []
    for number in range(round(1.0 / period_s) + 1):
        time_s = number * period_s
        yaw = math.remainder(3.0 + turn * time_s * factor, math.tau)
        way_m = speed * time_s * factor
        pose = Pose(way_m * math.cos(3.0), way_m * math.sin(3.0), yaw)
        found.append(Sighting(round(time_s * NS) + NS, round(time_s * factor * NS), pose))
    return found


@pytest.mark.parametrize("speed", [0.3, -0.3])
@pytest.mark.parametrize("factor", [1.0, 0.9])
def test_velocities_are_those_of_simulated_time(speed: float, factor: float) -> None:
    for twist in velocities(seen(speed=speed, factor=factor)):
        assert twist.linear_m_s == pytest.approx(speed)
        assert twist.angular_rad_s == pytest.approx(0.0)


def test_a_turn_past_half_a_turn_is_no_jump() -> None:
    found = velocities(seen(turn=1.0, factor=1.0))
    assert {round(twist.angular_rad_s, 6) for twist in found} == {1.0}


def test_times_that_jitter_change_no_velocity_by_much() -> None:
    even = seen(speed=0.3)
    jitter = [(-1) ** number * 2_000_000 for number in range(len(even))]
    uneven = [
        Sighting(one.time_ns + by, one.time_ns + by, one.pose)
        for one, by in zip(even, jitter, strict=True)
    ]
    for twist in velocities(uneven)[3:-3]:
        assert twist.linear_m_s == pytest.approx(0.3, rel=0.06)


def test_steps_lie_between_the_poses_and_carry_command_and_contact() -> None:
    commands = [(NS + NS // 2, Twist(0.3, 0.1))]
    truth = truth_of(seen(speed=0.3, period_s=0.1), commands, [(2 * NS - NS // 4, True)])
    assert [step.time_ns for step in truth] == [NS + number * NS // 100 for number in range(100)]
    half = truth[50]
    assert math.hypot(half.x_m, half.y_m) == pytest.approx(0.15)
    assert [step.command_m_s for step in truth] == [0.0] * 50 + [0.3] * 50
    assert [step.contact is not None for step in truth] == [False] * 75 + [True] * 25


def test_without_two_poses_there_is_no_truth() -> None:
    assert truth_of([], []) == () == truth_of(seen()[:1], [])


def test_the_real_time_factor_is_that_of_the_last_seconds() -> None:
    factor = RealTimeFactor(2.0)
    assert factor.now(0) is None
    for number in range(100):
        slow = min(number, 50) * NS // 20 + max(number - 50, 0) * NS // 200
        factor.note(number * NS // 20, slow)
        now = factor.now(number * NS // 20)
        if number < 40:
            assert now is None
        elif number <= 50:
            assert now == pytest.approx(1.0)
    assert factor.now(99 * NS // 20) == pytest.approx(0.1, abs=0.02)


def test_a_clock_that_stands_still_is_slow() -> None:
    factor = RealTimeFactor(2.0)
    for number in range(41):
        factor.note(number * NS // 20, number * NS // 20)
    late = factor.now(2 * NS + NS // 2)
    assert late == pytest.approx(1.0)
    assert factor.now(6 * NS) == pytest.approx(2 / 6)


def test_odometry_whose_driver_fills_in_the_pose_alone_has_speeds_all_the_same() -> None:
    """Its twist is always zero, though the robot drives at 0.2 m/s."""

    def message(tenth: int, speed_m_s: float) -> tuple[int, dict[str, Any]]:
        pose = {
            "position": {"x": 0.02 * tenth, "y": 0.0, "z": 0.0},
            "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        }
        twist = {"linear": {"x": speed_m_s}, "angular": {"z": 0.0}}
        return tenth * NS // 10, {"pose": {"pose": pose}, "twist": {"twist": twist}}

    for said_m_s, expected in ((0.0, 0.2), (0.19, 0.19)):
        truth = motion([message(tenth, said_m_s) for tenth in range(20)], ())
        assert truth[100].linear_m_s == pytest.approx(expected)
        assert truth[100].x_m == pytest.approx(0.2)
    assert motion([message(0, 0.0)], ()) == ()
