"""Exact motion, against closed forms and the matrix exponential."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from sim.motion import Pose, compose, integrate, relative, wrap_angle

SPEED = st.floats(-2.0, 2.0)
TURN = st.floats(-10.0, 10.0)
TIME = st.floats(0.0, 5.0)
POSE = st.builds(Pose, st.floats(-10, 10), st.floats(-10, 10), st.floats(-math.pi, math.pi))


def matrix(pose: Pose) -> np.ndarray:
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    return np.array([[cos, -sin, pose.x_m], [sin, cos, pose.y_m], [0.0, 0.0, 1.0]])


@given(POSE, SPEED, TURN, TIME)
def test_integrate_is_the_matrix_exponential(pose: Pose, v: float, w: float, t: float) -> None:
    generator = np.array([[0.0, -w, v], [w, 0.0, 0.0], [0.0, 0.0, 0.0]])
    expected = matrix(pose) @ expm(generator * t)
    assert np.allclose(matrix(integrate(pose, v, w, t)), expected, atol=1e-9)


@given(st.floats(1e-300, 1e-4), st.sampled_from([-1, 1]))
def test_integrate_is_exact_for_tiny_angular_velocities(w: float, sign: int) -> None:
    w *= sign
    end = integrate(Pose(0.0, 0.0, 0.0), 1.0, w, 1.0)
    # The Taylor series of sin(w) / w and (1 - cos(w)) / w; the next terms are below 1e-20.
    assert end.x_m == pytest.approx(1.0 - w**2 / 6.0 + w**4 / 120.0, rel=1e-15)
    assert end.y_m == pytest.approx(w / 2.0 - w**3 / 24.0 + w**5 / 720.0, rel=1e-14)


@given(POSE)
def test_integrate_without_velocity_keeps_every_bit(pose: Pose) -> None:
    assert integrate(pose, 0.0, 0.0, 0.01) == pose


@given(st.floats(-1e6, 1e6))
def test_wrapped_angle_is_the_same_direction(angle: float) -> None:
    wrapped = wrap_angle(angle)
    assert -math.pi <= wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


@given(st.floats(-math.pi, math.pi))
def test_wrapping_leaves_an_angle_in_range_alone(angle: float) -> None:
    assert wrap_angle(angle) == angle


@given(POSE, POSE)
def test_compose_is_the_product_of_matrices(parent: Pose, child: Pose) -> None:
    assert np.allclose(matrix(compose(parent, child)), matrix(parent) @ matrix(child), atol=1e-12)


@given(POSE, POSE)
def test_relative_is_the_inverse_of_compose(parent: Pose, child: Pose) -> None:
    back = matrix(relative(parent, compose(parent, child)))
    assert np.allclose(back, matrix(child), atol=1e-12)
