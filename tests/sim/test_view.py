"""The map in characters."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim.description import Layout, LidarOptions
from sim.lidar import Lidar
from sim.motion import NS, Pose
from sim.view import ARROWS, Drawing, Layer, Map, Run, hit_points, range_towards
from sim.world import World, parse_world

ROOM = parse_world("bounds: [-1, -2, 3, 4]")


def places(lines: list[list[Run]], layer: Layer) -> list[tuple[int, int, str]]:
    """Column, row and character of everything in a layer."""
    return [
        (column, row, character)
        for row, line in enumerate(lines)
        for column, (character, its) in enumerate(
            (character, run.layer) for run in line for character in run.text
        )
        if its is layer
    ]


@pytest.mark.parametrize("eighth", range(8))
def test_the_robot_points_where_it_heads(eighth: int) -> None:
    pose = Pose(0.0, 0.0, math.remainder(eighth * math.pi / 4, math.tau))
    lines = Drawing(World(), 0.1).lines(pose, 0, 21, 11)
    assert [place[2] for place in places(lines, Layer.ROBOT)] == [ARROWS[eighth]]


def test_the_map_has_the_size_that_was_asked_for() -> None:
    lines = Drawing(ROOM, 0.1).lines(Pose(0.0, 0.0, 0.0), 0, 40, 20)
    assert len(lines) == 20
    assert {sum(len(run.text) for run in line) for line in lines} == {40}


def test_left_and_up_are_where_they_belong() -> None:
    world = parse_world("circles: [{centre: [1, 0], radius: 0.05}, {centre: [0, 1], radius: 0.05}]")
    lines = Drawing(world, 0.05).lines(Pose(-1.0, -1.0, 0.0), 0, 40, 20)
    ((robot_column, robot_row, _),) = places(lines, Layer.ROBOT)
    walls = places(lines, Layer.WALL)
    assert all(column > robot_column for column, _, _ in walls)
    assert all(row < robot_row for _, row, _ in walls)


def test_the_robot_stays_visible_when_it_leaves_the_walls() -> None:
    drawing = Drawing(ROOM, 0.1)
    for x_m in (0.0, 10.0, -10.0, 0.0):
        assert len(places(drawing.lines(Pose(x_m, 20.0, 0.0), 0, 40, 20), Layer.ROBOT)) == 1


def test_drawing_again_leaves_nothing_behind() -> None:
    drawing = Drawing(ROOM, 0.1)
    first = drawing.lines(Pose(0.0, 0.0, 0.0), 0, 40, 20)
    drawing.lines(Pose(2.0, 2.0, 1.0), 0, 40, 20, [(1.0, 1.0)])
    assert drawing.lines(Pose(0.0, 0.0, 0.0), 0, 40, 20) == first


def test_dots_are_as_far_apart_as_metres_say() -> None:
    canvas = Map((0.0, 0.0, 4.0, 4.0), 40, 20)
    canvas.point(1.0, 1.0, Layer.WALL)
    canvas.point(1.0 + 2 / canvas.dots_per_m, 1.0, Layer.HIT)
    ((wall, row, _),) = places(canvas.lines(), Layer.WALL)
    assert [(c, r) for c, r, _ in places(canvas.lines(), Layer.HIT)] == [(wall + 1, row)]


def test_what_is_outside_is_left_out() -> None:
    canvas = Map((0.0, 0.0, 1.0, 1.0), 10, 5)
    canvas.point(100.0, 0.0, Layer.WALL)
    canvas.letter(-100.0, 0.0, "x", Layer.ROBOT)
    assert len(places(canvas.lines(), Layer.EMPTY)) == 50


def test_moving_obstacles_are_drawn_while_they_are_there() -> None:
    world = parse_world(
        "moving: [{circle: {radius: 0.2}, path: [{at: 0 s, pose: [1, 1]}], appears: 1 s}]"
    )
    for time_ns, drawn in ((0, False), (NS, True)):
        lines = Drawing(world, 0.1).lines(Pose(0.0, 0.0, 0.0), time_ns, 40, 20)
        assert bool(places(lines, Layer.MOVING)) is drawn


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
