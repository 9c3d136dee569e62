"""Ranges, against a scalar ray caster of other formulas, and symmetry."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from sim.description import Layout, LidarOptions, NoReturn
from sim.lidar import Lidar
from sim.motion import Pose, compose
from sim.shapes import Shape, box, circle, wall
from sim.world import World, parse_world

FAR = LidarOptions(range_max=1000.0, range_min=0.001)
ORIGIN = Pose(0.0, 0.0, 0.0)
NUMBER = st.floats(-4.0, 4.0).map(lambda x: round(x, 4))
WALLS = st.lists(
    st.tuples(NUMBER, NUMBER, NUMBER, NUMBER).filter(lambda s: abs(s[0] - s[2]) > 0.01),
    min_size=1,
    max_size=12,
)
CIRCLES = st.lists(st.tuples(NUMBER, NUMBER, st.floats(0.01, 1.5)), min_size=1, max_size=6)
POSE = st.builds(Pose, NUMBER, NUMBER, st.floats(-math.pi, math.pi))


def lidar(shapes: list[Shape], options: LidarOptions = FAR) -> Lidar:
    return Lidar(World(tuple(shapes)), options)


def ray_wall(start: complex, ray: complex, a: complex, b: complex) -> tuple[float, bool]:
    """Distance along a ray to a segment, and whether rounding may decide it.

    The frame is turned until the ray is the positive real axis: the segment is hit where it
    crosses that axis.
    """
    a, b = (a - start) / ray, (b - start) / ray
    if abs(a.imag) < 1e-6 or abs(b.imag) < 1e-6:
        return math.inf, True
    if a.imag * b.imag > 0.0:
        return math.inf, False
    share = a.imag / (a.imag - b.imag)
    x = a.real + share * (b.real - a.real)
    return (x if x > 0.0 else math.inf), abs(x) < 1e-6


def ray_circle(start: complex, ray: complex, c: complex, r: float) -> tuple[float, bool]:
    """Distance along a ray to a circle by its quadratic: |s ray - (c - start)| = r."""
    c = (c - start) / ray
    disc = r**2 - c.imag**2
    if abs(disc) < 1e-6:
        return math.inf, True
    if disc < 0.0:
        return math.inf, False
    roots = [c.real - math.sqrt(disc), c.real + math.sqrt(disc)]
    ahead = [root for root in roots if root > 0.0]
    return min(ahead, default=math.inf), any(abs(root) < 1e-6 for root in roots)


@given(WALLS, CIRCLES, POSE)
@settings(max_examples=40, deadline=None)
def test_ranges_are_those_of_a_scalar_ray_caster(
    walls: list[tuple[float, float, float, float]],
    circles: list[tuple[float, float, float]],
    pose: Pose,
) -> None:
    sensor = lidar([wall("w", *w) for w in walls] + [circle("c", *c) for c in circles])
    found = sensor.cast(pose, 0)
    start = complex(pose.x_m, pose.y_m)
    for beam in range(360):
        ray = cmath.rect(1.0, pose.yaw_rad + math.radians(beam))
        hits = [ray_wall(start, ray, complex(*w[:2]), complex(*w[2:])) for w in walls]
        hits += [ray_circle(start, ray, complex(*c[:2]), c[2]) for c in circles]
        if not any(doubtful for _, doubtful in hits):
            assert found[beam] == pytest.approx(min(hit for hit, _ in hits), rel=1e-7, abs=1e-9)


@given(WALLS, CIRCLES, POSE)
@settings(max_examples=50, deadline=None)
def test_a_mirrored_world_gives_the_mirrored_scan(
    walls: list[tuple[float, float, float, float]],
    circles: list[tuple[float, float, float]],
    pose: Pose,
) -> None:
    shapes = [wall("w", *w) for w in walls] + [circle("c", *c) for c in circles]
    # On a wall the direction to it is undefined.
    assume(all(abs(shape.clearance_m(pose.x_m, pose.y_m)) > 1e-3 for shape in shapes))
    mirrored = [wall("w", x1, -y1, x2, -y2) for x1, y1, x2, y2 in walls]
    mirrored += [circle("c", x, -y, r) for x, y, r in circles]
    there = lidar(mirrored).cast(Pose(pose.x_m, -pose.y_m, -pose.yaw_rad), 0)
    here = lidar(shapes).cast(pose, 0)
    # Beam k looks where beam -k looks in the mirror. A beam that just misses an end may just
    # hit it there, which few do.
    differs = ~np.isclose(np.roll(there[::-1], 1), here, rtol=1e-7, atol=1e-9)
    assert np.count_nonzero(differs) <= 8


@given(POSE, st.integers(0, 359))
@settings(max_examples=50, deadline=None)
def test_turning_by_whole_beams_shifts_the_scan(pose: Pose, beams: int) -> None:
    sensor = lidar([circle("c", 0.3, 6.0, 0.7), box("b", Pose(-6.0, 0.0, 0.3), (1.0, 2.0))])
    turned = Pose(pose.x_m, pose.y_m, pose.yaw_rad + math.radians(beams))
    differs = ~np.isclose(sensor.cast(turned, 0), np.roll(sensor.cast(pose, 0), -beams), rtol=1e-6)
    assert np.count_nonzero(differs) <= 4  # beams along an edge


@pytest.mark.parametrize("yaw_deg", [0.0, 17.3, 90.0, -123.4])
def test_no_beam_slips_through_a_corner(yaw_deg: float) -> None:
    """Walls that meet at 720 points; a beam goes through every other one exactly."""
    yaw = math.radians(yaw_deg)
    points = [
        (2.0 * math.cos(yaw + math.radians(i / 2)), 2.0 * math.sin(yaw + math.radians(i / 2)))
        for i in range(720)
    ]
    shapes = [wall("w", *a, *b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
    found = lidar(shapes).cast(Pose(0.0, 0.0, yaw), 0)
    assert found == pytest.approx(np.full(360, 2.0), abs=1e-4)


def test_a_wall_seen_along_its_length_is_hit_at_its_nearer_end() -> None:
    for x1, x2 in ((1.0, 2.0), (2.0, 1.0)):
        found = lidar([wall("w", x1, 0.0, x2, 0.0)]).cast(ORIGIN, 0)
        assert found[0] == 1.0
        assert np.isinf(found[1:]).all()


@pytest.mark.parametrize("beams", [1, 4, 360, 1000])
@pytest.mark.parametrize("layout", list(Layout))
def test_each_beam_looks_where_the_angles_say(beams: int, layout: Layout) -> None:
    options = LidarOptions(beams=beams, layout=layout, range_max=100.0)
    for beam in range(0, beams, max(1, beams // 7)):
        target = 0.3 + 2.0 * math.pi * beam / beams
        needle = circle("c", 5 * math.cos(target), 5 * math.sin(target), 0.001)
        sensor = lidar([needle], options)
        angle = sensor.angle_min_rad + beam * sensor.angle_increment_rad
        # Turn the robot so that exactly this beam looks at the needle.
        seen = sensor.cast(Pose(0.0, 0.0, target - angle), 0)
        assert seen[beam] == pytest.approx(4.999)
        assert np.count_nonzero(np.isfinite(seen)) == 1


def test_the_other_layout_is_the_same_scan_rolled_by_half_a_turn() -> None:
    shapes = list(parse_world("bounds: [-1, -2, 3, 4]").shapes)
    first = lidar(shapes, LidarOptions()).cast(ORIGIN, 0)
    second = lidar(shapes, LidarOptions(layout=Layout.FROM_MINUS_PI)).cast(ORIGIN, 0)
    assert second == pytest.approx(np.roll(first, 180))


def scan(shapes: list[Shape], seed: int = 0, **options: object) -> np.ndarray:
    sensor = lidar(shapes, LidarOptions.model_validate(options))
    return sensor.scan(ORIGIN, 0, np.random.default_rng(seed)).ranges_m


NEAR_AND_FAR = [
    wall("w", 0.11, -0.001, 0.11, 0.001),  # ahead, below the range
    wall("w", -0.001, 1.0, 0.001, 1.0),  # left
    wall("w", -3.4999, -0.01, -3.4999, 0.01),  # behind, just within the range
    wall("w", -0.01, -3.5001, 0.01, -3.5001),  # right, just beyond the range
]


def test_beams_without_a_distance_are_infinite_as_in_rep_117() -> None:
    found = scan(NEAR_AND_FAR)
    assert found[[0, 90, 180, 270]].tolist() == [-math.inf, 1.0, pytest.approx(3.4999), math.inf]


def test_beams_without_a_distance_are_zero_on_the_real_sensor() -> None:
    found = scan(NEAR_AND_FAR, no_return=NoReturn.ZERO)
    assert found[[0, 90, 180, 270]].tolist() == [0.0, 1.0, pytest.approx(3.4999), 0.0]


def test_noise_has_the_deviation_that_was_asked_for() -> None:
    room = [circle("c", 0.0, 0.0, 2.0)]
    errors = np.concatenate([scan(room, seed, noise="10 mm") - 2.0 for seed in range(100)])
    assert np.std(errors) == pytest.approx(0.01, rel=0.02)
    assert np.mean(errors) == pytest.approx(0.0, abs=0.0003)


def test_the_sensor_may_sit_anywhere_on_the_robot() -> None:
    shapes = list(parse_world("bounds: [-1, -2, 3, 4]").shapes)
    offset = Pose(0.5, -0.25, math.pi / 2)
    moved = lidar(shapes, LidarOptions(pose=[0.5, -0.25, "90 deg"], range_max=100.0))
    robot = Pose(0.3, 0.2, 0.7)
    straight = lidar(shapes, LidarOptions(range_max=100.0))
    assert moved.cast(robot, 0) == pytest.approx(straight.cast(compose(robot, offset), 0))
    assert moved.cast(ORIGIN, 0)[0] == pytest.approx(4.25)


def test_moving_obstacles_are_seen_where_they_are_at_the_time() -> None:
    world = parse_world(
        "moving:\n- box: {size: [0.2, 2]}\n  appears: 1 s\n"
        "  path: [{at: 0 s, pose: [2, 0]}, {at: 2 s, pose: [3, 0]}]"
    )
    sensor = Lidar(world, LidarOptions())
    assert np.isinf(sensor.cast(ORIGIN, 0)).all()
    assert sensor.cast(ORIGIN, 1_000_000_000)[0] == pytest.approx(2.4)
    assert sensor.cast(ORIGIN, 5_000_000_000)[0] == pytest.approx(2.9)


@pytest.mark.parametrize("no_return", list(NoReturn))
def test_intensities_fall_with_the_distance_and_are_0_without_one(no_return: NoReturn) -> None:
    sensor = lidar(NEAR_AND_FAR, LidarOptions(no_return=no_return))
    found = sensor.scan(ORIGIN, 0, np.random.default_rng(0)).intensities
    assert found[90] > found[180] > 0.0
    assert not found[[45, 270]].any()
