"""The map in characters."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim.description import Layout, LidarOptions
from sim.lidar import Lidar
from sim.motion import NS, Pose
from sim.view import ARROWS, Layer, Map, draw, hit_points, range_towards
from sim.world import World, parse_world

ROOM = parse_world("bounds: [-1, -2, 3, 4]")


@pytest.mark.parametrize("eighth", range(8))
def test_the_robot_points_where_it_heads(eighth: int) -> None:
    pose = Pose(0.0, 0.0, math.remainder(eighth * math.pi / 4, math.tau))
    cells = draw(World(), pose, 0.1, 0, 21, 11)
    robots = [cell for line in cells for cell in line if cell.layer is Layer.ROBOT]
    assert [cell.character for cell in robots] == [ARROWS[eighth]]


def test_the_map_has_the_size_that_was_asked_for() -> None:
    cells = draw(ROOM, Pose(0.0, 0.0, 0.0), 0.1, 0, 40, 20)
    assert len(cells) == 20
    assert {len(line) for line in cells} == {40}


def test_left_and_up_are_where_they_belong() -> None:
    world = parse_world("circles: [{centre: [1, 0], radius: 0.05}, {centre: [0, 1], radius: 0.05}]")
    cells = draw(world, Pose(-1.0, -1.0, 0.0), 0.05, 0, 40, 20)
    places = {
        layer: [
            (x, y) for y, line in enumerate(cells) for x, c in enumerate(line) if c.layer is layer
        ]
        for layer in (Layer.WALL, Layer.ROBOT)
    }
    (robot,) = places[Layer.ROBOT]
    assert all(x > robot[0] for x, _ in places[Layer.WALL])
    assert all(y < robot[1] for _, y in places[Layer.WALL])


def test_dots_are_as_far_apart_as_metres_say() -> None:
    canvas = Map((0.0, 0.0, 4.0, 4.0), 40, 20)
    canvas.point(1.0, 1.0, Layer.WALL)
    canvas.point(1.0 + 2 / canvas.dots_per_m, 1.0, Layer.HIT)
    layers = [cell.layer for line in canvas.cells() for cell in line]
    assert layers.index(Layer.HIT) - layers.index(Layer.WALL) == 1


def test_what_is_outside_is_left_out() -> None:
    canvas = Map((0.0, 0.0, 1.0, 1.0), 10, 5)
    canvas.point(100.0, 0.0, Layer.WALL)
    canvas.letter(-100.0, 0.0, "x", Layer.ROBOT)
    assert all(cell.layer is Layer.EMPTY for line in canvas.cells() for cell in line)


def test_moving_obstacles_are_drawn_while_they_are_there() -> None:
    world = parse_world(
        "moving: [{circle: {radius: 0.2}, path: [{at: 0 s, pose: [1, 1]}], appears: 1 s}]"
    )
    for time_ns, drawn in ((0, False), (NS, True)):
        cells = draw(world, Pose(0.0, 0.0, 0.0), 0.1, time_ns, 40, 20)
        assert any(cell.layer is Layer.MOVING for line in cells for cell in line) is drawn


@pytest.mark.parametrize("layout", list(Layout))
def test_beams_end_on_the_walls(layout: Layout) -> None:
    lidar = Lidar(ROOM, LidarOptions(layout=layout, range_max=10.0))
    pose = Pose(0.5, 0.5, 0.4)
    scan = lidar.scan(pose, 0, np.random.default_rng(0))
    points = hit_points(lidar, scan, pose)
    assert len(points) == 360
    for x, y in points:
        edges = (abs(x + 1), abs(x - 3), abs(y + 2), abs(y - 4))
        assert min(edges) == pytest.approx(0.0, abs=1e-5)
    assert range_towards(lidar, scan, 0.0) == pytest.approx(2.5 / math.cos(0.4), rel=1e-5)


def test_beams_without_a_distance_end_nowhere() -> None:
    lidar = Lidar(World(), LidarOptions(no_return="zero"))
    assert (
        hit_points(lidar, lidar.scan(Pose(0, 0, 0), 0, np.random.default_rng(0)), Pose(0, 0, 0))
        == []
    )
