"""The drive: limits of speed and acceleration."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.motion import REST, Pose, Twist
from sim.robot import BURGER, WAFFLE, RobotModel, State, step

DT_S = 0.01
COMMAND = st.builds(Twist, st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
MODEL = st.sampled_from([BURGER, WAFFLE])


def test_the_models_have_the_figures_of_the_manual() -> None:
    assert (BURGER.limits.speed_m_s, BURGER.limits.angular_speed_rad_s) == (0.22, 2.84)
    assert (WAFFLE.limits.speed_m_s, WAFFLE.limits.angular_speed_rad_s) == (0.26, 1.82)
    assert (BURGER.wheel_separation_m, WAFFLE.wheel_separation_m) == (0.160, 0.287)


@given(MODEL, st.lists(COMMAND, max_size=60))
def test_no_command_exceeds_a_limit(model: RobotModel, commands: list[Twist]) -> None:
    limits, state = model.limits, State(Pose(0.0, 0.0, 0.0))
    for command in commands:
        after = step(state, command, DT_S, limits)
        v, w = after.twist.linear_m_s, after.twist.angular_rad_s
        assert abs(v) <= limits.speed_m_s
        assert abs(w) <= limits.angular_speed_rad_s
        change = abs(v - state.twist.linear_m_s)
        assert change <= limits.acceleration_m_s2 * DT_S + 1e-15
        turn = abs(w - state.twist.angular_rad_s)
        assert turn <= limits.angular_acceleration_rad_s2 * DT_S + 1e-14
        state = after


@given(MODEL, st.floats(-0.2, 0.2), st.floats(-1.5, 1.5))
def test_a_command_within_the_limits_is_reached_exactly(
    model: RobotModel, v: float, w: float
) -> None:
    state = State(Pose(0.0, 0.0, 0.0))
    for _ in range(60):
        state = step(state, Twist(v, w), DT_S, model.limits)
    assert state.twist == Twist(v, w)


def test_speeding_up_takes_as_long_as_the_acceleration_says() -> None:
    state, steps = State(Pose(0.0, 0.0, 0.0)), 0
    while state.twist.linear_m_s < 0.22:
        state, steps = step(state, Twist(0.22, 0.0), DT_S, BURGER.limits), steps + 1
    assert steps == 22  # 0.22 m/s at 1 m/s² in steps of 0.01 s


def test_braking_distance_is_that_of_constant_deceleration() -> None:
    state = State(Pose(0.0, 0.0, 0.0), Twist(0.2, 0.0))
    while state.twist != REST:
        state = step(state, REST, DT_S, BURGER.limits)
    # 0.19 + 0.18 + ... + 0.01 m/s for 0.01 s each.
    assert state.pose.x_m == pytest.approx(sum(range(1, 20)) / 100 * DT_S)


@given(st.floats(-10, 10), st.floats(-10, 10), st.floats(-math.pi, math.pi), MODEL)
def test_a_robot_at_rest_stays_at_rest_to_the_last_bit(
    x: float, y: float, yaw: float, model: RobotModel
) -> None:
    state = State(Pose(x, y, yaw))
    for command in (REST, Twist(-0.0, -0.0)):
        after = step(state, command, DT_S, model.limits)
        assert after == state
        assert math.copysign(1.0, after.twist.linear_m_s) == 1.0


@given(st.floats(-0.2, 0.2), st.floats(0.05, 2.0))
def test_a_whole_circle_ends_where_it_began(v: float, turn: float) -> None:
    steps = round(2 * math.pi / (turn * DT_S))
    w = 2 * math.pi / (steps * DT_S)
    state = State(Pose(1.0, 2.0, 0.5), Twist(v, w))
    for _ in range(steps):
        state = step(state, Twist(v, w), DT_S, BURGER.limits)
    assert (state.pose.x_m, state.pose.y_m) == pytest.approx((1.0, 2.0), abs=1e-10)
    assert state.pose.yaw_rad == pytest.approx(0.5, abs=1e-10)
