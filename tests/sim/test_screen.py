"""What is shown in the terminal: the map in characters, and the figures."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from rich.text import Text

from sim.description import Layout, LidarOptions, SimulatorOptions
from sim.lidar import Lidar
from sim.motion import NS, Pose, Twist
from sim.pacing import Lateness
from sim.screen import ARROWS, STYLES, Screen, draw, hit_points, range_towards
from sim.simulation import make_simulation
from sim.world import World, parse_world, read_world

WORLDS = Path(__file__).parent / "worlds"


def test_the_screen_shows_everything() -> None:
    world = read_world(WORLDS / "wall.yaml", {"wall_x": 0.3})
    simulation = make_simulation(world, SimulatorOptions())
    screen = Screen(simulation)
    assert "→" in screen.picture(80, 30).plain  # before the first step
    assert screen.line() == "starting"
    for index in range(300):
        screen.on_step(simulation.advance(Twist(0.2, 0.0) if index == 0 else None), 0, "")
    screen.on_late(Lateness(7, 3, 40_000_000))
    line = screen.line()
    assert "3.00 s  x +0.200 m" in line
    assert line.endswith("ahead -inf m  CONTACT with a wall  3 steps late")
    text = screen.picture(80, 30).plain
    for part in (
        "wall.yaml, burger",
        "x +0.200 m",
        "+0.200 m/s",
        "with a wall",
        "at most 40 ms",
        "→",
    ):
        assert part in text


def test_commands_that_are_not_finite_are_counted() -> None:
    simulation = make_simulation(read_world(WORLDS / "empty.yaml"), SimulatorOptions())
    screen = Screen(simulation)
    for speed in (math.nan, 0.1, math.inf):
        screen.on_step(simulation.advance(Twist(speed, 0.0)), 0, "")
    assert screen.line().endswith("2 commands not finite: the robot stops instead")


ROOM = parse_world("bounds: [-1, -2, 3, 4]")


WALL, MOVING, HIT, _, ROBOT = STYLES[1:]


def drawn(
    world: World, pose: Pose, time_ns: int = 0, hits: tuple[tuple[float, float], ...] = ()
) -> Text:
    return draw(world, pose, 0.05, time_ns, np.array(hits).reshape(-1, 2), (40, 20))


def places(text: Text, style: str) -> list[tuple[int, int, str]]:
    """Column, row and character of everything in a style."""
    return [
        (index % 41, index // 41, text.plain[index])
        for span in text.spans
        for index in range(span.start, span.end)
        if span.style == style
    ]


@pytest.mark.parametrize("eighth", range(8))
def test_the_robot_points_where_it_heads(eighth: int) -> None:
    lines = drawn(World(), Pose(0.0, 0.0, math.remainder(eighth * math.pi / 4, math.tau)))
    assert [place[2] for place in places(lines, ROBOT)] == [ARROWS[eighth]]


def test_the_map_has_the_size_that_was_asked_for() -> None:
    lines = drawn(ROOM, Pose(0.0, 0.0, 0.0))
    assert [len(line) for line in lines.plain.splitlines()] == [40] * 20


def test_left_and_up_are_where_they_belong() -> None:
    world = parse_world("circles: [{centre: [1, 0], radius: 0.05}, {centre: [0, 1], radius: 0.05}]")
    lines = drawn(world, Pose(-1.0, -1.0, 0.0))
    ((robot_column, robot_row, _),) = places(lines, ROBOT)
    walls = places(lines, WALL)
    assert all(column > robot_column and row < robot_row for column, row, _ in walls)


def test_the_robot_stays_visible_when_it_leaves_the_walls() -> None:
    for x_m in (0.0, 10.0, -10.0):
        assert len(places(drawn(ROOM, Pose(x_m, 20.0, 0.0)), ROBOT)) == 1


def test_hits_outside_the_map_are_left_out() -> None:
    lines = drawn(ROOM, Pose(0.0, 0.0, 0.0), hits=((2.0, 2.0), (100.0, 0.0)))
    assert len(places(lines, HIT)) == 1


def test_moving_obstacles_are_drawn_while_they_are_there() -> None:
    world = parse_world(
        "moving: [{circle: {radius: 0.2}, path: [{at: 0 s, pose: [1, 1]}], appears: 1 s}]"
    )
    for time_ns, is_drawn in ((0, False), (NS, True)):
        lines = drawn(world, Pose(0.0, 0.0, 0.0), time_ns)
        assert bool(places(lines, MOVING)) is is_drawn


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
    pose = Pose(0.0, 0.0, 0.0)
    lidar = Lidar(World(), LidarOptions(no_return="zero"))
    assert not len(hit_points(lidar, lidar.scan(pose, 0, np.random.default_rng(0)), pose))
