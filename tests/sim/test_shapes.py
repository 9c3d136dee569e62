"""Distances, against a dense set of points and complex numbers."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sim.motion import Pose
from sim.shapes import box, chord_clearance_m, circle, point_clearance_m, polygon

NUMBER = st.floats(-5.0, 5.0).map(lambda x: round(x, 3))
POINT = st.tuples(NUMBER, NUMBER)


def distance_by_samples(p: complex, a: complex, b: complex) -> float:
    """Least distance from p to 20,001 points of the segment a-b; never below the true one."""
    return min(abs(p - (a + (b - a) * i / 20_000)) for i in range(20_001))


@given(POINT, POINT, POINT)
def test_point_distance_is_that_of_the_nearest_sample(
    p: tuple[float, float], a: tuple[float, float], b: tuple[float, float]
) -> None:
    exact = point_clearance_m(*p, (*a, *b, 0.0))
    sampled = distance_by_samples(complex(*p), complex(*a), complex(*b))
    assert exact <= sampled + 1e-9
    assert exact >= sampled - abs(complex(*a) - complex(*b)) / 20_000


@given(POINT, POINT, POINT, POINT, st.floats(0.0, 1.0))
def test_no_point_of_a_chord_is_nearer_than_its_clearance(
    p: tuple[float, float],
    q: tuple[float, float],
    a: tuple[float, float],
    b: tuple[float, float],
    share: float,
) -> None:
    capsule = (*a, *b, 0.0)
    least = chord_clearance_m(*p, *q, capsule)
    x, y = p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])
    assert point_clearance_m(x, y, capsule) >= least - 1e-9


def test_chords_that_cross_a_wall_have_no_clearance() -> None:
    assert chord_clearance_m(0.0, -1.0, 0.1, 1.0, (-1.0, 0.0, 1.0, 0.0, 0.0)) == 0.0


def test_chord_clearance_is_reached() -> None:
    assert chord_clearance_m(0.0, 1.0, 4.0, 1.0, (2.0, 0.0, 2.0, 0.5, 0.0)) == pytest.approx(0.5)
    assert chord_clearance_m(0.0, 1.0, 4.0, 1.0, (2.0, 0.0, 2.0, 0.0, 0.25)) == pytest.approx(0.75)


@given(POINT, POINT, st.floats(0.01, 2.0))
def test_the_clearance_of_a_circle_is_from_its_edge(
    p: tuple[float, float], c: tuple[float, float], r: float
) -> None:
    assert circle("c", *c, r).clearance_m(*p) == pytest.approx(
        abs(complex(*p) - complex(*c)) - r, abs=1e-12
    )


@given(POINT, st.floats(-math.pi, math.pi), st.floats(0.1, 3.0), st.floats(0.1, 3.0))
def test_box_clearance_is_that_of_the_upright_box_in_its_own_frame(
    p: tuple[float, float], yaw: float, length: float, width: float
) -> None:
    shape = box("b", Pose(0.3, -0.2, yaw), (length, width))
    own = complex(p[0] - 0.3, p[1] + 0.2) * complex(math.cos(yaw), -math.sin(yaw))
    dx, dy = abs(own.real) - length / 2, abs(own.imag) - width / 2
    assume(min(abs(dx), abs(dy)) > 1e-9)
    expected = math.hypot(max(dx, 0.0), max(dy, 0.0)) if max(dx, dy) > 0.0 else max(dx, dy)
    assert shape.clearance_m(*p) == pytest.approx(expected, abs=1e-9)


def test_a_polygon_with_a_notch_is_not_filled_in_the_notch() -> None:
    notched = polygon("p", ((0, 0), (4, 0), (4, 4), (2, 1), (0, 4)))
    assert not notched.contains(2.0, 3.0)
    assert notched.contains(0.5, 1.0)
    assert notched.clearance_m(0.5, 1.0) < 0.0
