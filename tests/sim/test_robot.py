"""The drive: limits of speed and acceleration."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.motion import REST, Twist
from sim.robot import BURGER, WAFFLE, RobotModel, next_velocity

DT_S = 0.01
COMMAND = st.builds(Twist, st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
MODEL = st.sampled_from([BURGER, WAFFLE])


def test_the_models_have_the_figures_of_the_manual() -> None:
    assert (BURGER.limits.speed_m_s, BURGER.limits.angular_speed_rad_s) == (0.22, 2.84)
    assert (WAFFLE.limits.speed_m_s, WAFFLE.limits.angular_speed_rad_s) == (0.26, 1.82)
    assert (BURGER.wheel_separation_m, WAFFLE.wheel_separation_m) == (0.160, 0.287)


@given(MODEL, st.lists(COMMAND, max_size=60))
def test_no_command_exceeds_a_limit(model: RobotModel, commands: list[Twist]) -> None:
    limits, before = model.limits, REST
    for command in commands:
        after = next_velocity(before, command, DT_S, limits)
        assert abs(after.linear_m_s) <= limits.speed_m_s
        assert abs(after.angular_rad_s) <= limits.angular_speed_rad_s
        change = abs(after.linear_m_s - before.linear_m_s)
        assert change <= limits.acceleration_m_s2 * DT_S + 1e-15
        turn = abs(after.angular_rad_s - before.angular_rad_s)
        assert turn <= limits.angular_acceleration_rad_s2 * DT_S + 1e-14
        before = after


@given(MODEL, st.floats(-0.2, 0.2), st.floats(-1.5, 1.5))
def test_a_command_within_the_limits_is_reached_exactly(
    model: RobotModel, v: float, w: float
) -> None:
    twist = REST
    for _ in range(60):
        twist = next_velocity(twist, Twist(v, w), DT_S, model.limits)
    assert twist == Twist(v, w)


@pytest.mark.parametrize(("begin", "end"), [(0.0, 0.22), (0.22, 0.0)])
def test_speeding_up_and_braking_take_as_long_as_the_acceleration_says(
    begin: float, end: float
) -> None:
    twist, steps = Twist(begin, 0.0), 0
    while twist.linear_m_s != end:
        twist, steps = next_velocity(twist, Twist(end, 0.0), DT_S, BURGER.limits), steps + 1
    assert steps == 22  # 0.22 m/s at 1 m/s² in steps of 0.01 s


def test_a_commanded_minus_zero_is_rest() -> None:
    assert (
        math.copysign(1.0, next_velocity(REST, Twist(-0.0, -0.0), 0.01, BURGER.limits).linear_m_s)
        == 1.0
    )
