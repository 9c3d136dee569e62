"""World files: what they mean, and the messages about mistakes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from grader.errors import AssignmentError, UsageError
from sim.motion import NS, Pose
from sim.world import MAX_MOVING, MAX_SEGMENTS, parse_world, read_world

WORLDS = Path(__file__).parent / "worlds"


def clearance(text: str, x_m: float, y_m: float) -> float:
    return min(shape.clearance_m(x_m, y_m) for shape in parse_world(text).shapes)


def test_bare_numbers_are_metres_and_units_are_converted() -> None:
    assert clearance("segments: [[100 cm, -1, 1000 mm, 1e0]]", 0.0, 0.0) == pytest.approx(1.0)


def test_every_kind_of_shape_is_where_it_says() -> None:
    assert clearance("bounds: [-1, -2, 3, 4]", 0.0, 0.0) == pytest.approx(1.0)
    assert clearance("circles: [{centre: [3, 4], radius: 50 cm}]", 0, 0) == pytest.approx(4.5)
    assert clearance("boxes: [{centre: [2, 0], size: [1, 4]}]", 0, 0) == pytest.approx(1.5)
    turned = "boxes: [{centre: [3, 0], size: [1, 4], yaw: 90 deg}]"
    assert clearance(turned, 0, 0) == pytest.approx(1.0)
    area = "polygons: [{points: [[1, -1], [2, -1], [2, 1], [1, 1]]}]"
    assert clearance(area, 0, 0) == pytest.approx(1.0)
    assert clearance(area, 1.5, 0) == pytest.approx(-0.5)


def test_the_robot_starts_where_the_world_says() -> None:
    assert parse_world("start: [1, -2, 180 deg]").start == Pose(
        1.0, -2.0, pytest.approx(3.1415926535)
    )
    assert parse_world("segments: []").start == Pose(0.0, 0.0, 0.0)


def test_values_are_put_in_place_of_their_names() -> None:
    text = "values: {x: 1.5, when: 2 s}\nsegments: [[$x, -1, $x, 1]]\n"
    text += "moving: [{circle: {radius: 0.1}, path: [{at: 0 s, pose: [0, $x]}], appears: $when}]"
    assert parse_world(text).shapes[0].clearance_m(0, 0) == pytest.approx(1.5)
    world = parse_world(text, values={"x": "70 cm", "when": "4 s"})
    assert world.shapes[0].clearance_m(0, 0) == pytest.approx(0.7)
    assert world.moving[0].appears_ns == 4 * NS
    assert world.moving[0].path[0].pose.y_m == pytest.approx(0.7)


WALKER = "moving:\n  - circle: {radius: 0.1}\n    path:\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("boxs: []", r"w.yaml:1: boxs: unknown key 'boxs'. Did you mean 'boxes'\?"),
        (
            "circles:\n  - {centre: [0, 0], radios: 1}",
            r"w.yaml:2: circles\[0\].radios: unknown key 'radios'. Did you mean 'radius'\?",
        ),
        (
            "boxes:\n  - {centre: [0, 0], size: [-1, 2]}",
            r"w.yaml:2: boxes\[0\].size: length: -1 is too small: it must be more than 0",
        ),
        ("segments:\n  - [0, 0, 0, 0]", r"w.yaml:2: segments\[0\]: both ends are the same point"),
        (
            "boxes: [{centre: [0, 0], size: [1, 1e-9]}]",
            r"width: 1e-09 is too small: it must be at l",
        ),
        ("segments:\n  - [0, .nan, 1, 1]", r"w.yaml:2: segments\[0\]: y1: nan is not finite"),
        ("segments:\n  - [0, 3 deg, 1, 1]", r"segments\[0\]: y1: 'deg' is a unit of angle"),
        ("segments:\n  - [0, 0, 1, 1e9]", r"segments\[0\]: y2: 1000000000.0 is too far away: at m"),
        ("start: [0, 0, 90]", r"w.yaml:1: start: yaw: 90 has no unit: write '90 deg' or '90 rad'"),
        (
            "bounds: [1, 1, 0, 0]",
            r"w.yaml:1: bounds: expected \[x_min, y_min, x_max, y_max\]: each",
        ),
        (
            "polygons:\n  - {points: [[0, 0], [1, 1]]}",
            r"w.yaml:2: polygons\[0\].points: expected at least 3 entries",
        ),
        (
            "polygons:\n  - points:\n    - [0, 0]\n    - [1, 1]\n    - [1, 1]",
            r"w.yaml:2: polygons\[0\]: points\[2\] is the same point as the one before",
        ),
        (
            "moving:\n  - path: [{at: 0 s, pose: [0, 0]}]",
            r"w.yaml:2: moving\[0\]: give either 'cir",
        ),
        (
            WALKER + "      - {at: 3, pose: [0, 0]}",
            r"w.yaml:4: moving\[0\].path\[0\].at: 3 has no unit",
        ),
        (
            WALKER + "      - {at: 0 s, pose: [0, 0]}\n      - {at: 1 s, pose: [0, 10]}",
            r"w.yaml:2: moving\[0\]: from path\[0\] to path\[1\] it moves at 10 m/s: at most 5 m/s",
        ),
        (
            WALKER + "      - {at: 2 s, pose: [0, 0]}\n      - {at: 2 s, pose: [0, 1]}",
            r"w.yaml:2: moving\[0\]: path\[1\] is not later than path\[0\]",
        ),
        (
            WALKER + "      - {at: 0 s, pose: [0, 0]}\n      - {at: 2 s, pose: [0, 1]}\n"
            "    repeat: true",
            r"w.yaml:2: moving\[0\]: to repeat, the last waypoint must be where the first one is",
        ),
        (
            WALKER + "      - {at: 0 s, pose: [0, 0]}\n    appears: 3 s\n    disappears: 2 s",
            r"w.yaml:2: moving\[0\]: it disappears before it appears",
        ),
        (
            "values: {wall: 2}\nsegments:\n  - [0, 0, $wal, 1]",
            r"w.yaml:3: segments\[0\]\[2\]: '\$wal' is not among the 'values' of this world. "
            r"Did you mean 'wall'\?",
        ),
    ],
)
def test_a_mistake_is_reported_with_file_and_line(text: str, message: str) -> None:
    with pytest.raises(AssignmentError, match=message):
        parse_world(text, Path("w.yaml"))


def test_all_mistakes_are_reported_at_once() -> None:
    with pytest.raises(AssignmentError) as caught:
        parse_world("segments:\n  - [0]\n  - [1]\ncircles: [{radius: 1}]")
    assert [problem.line for problem in caught.value.problems] == [2, 3, 4]


def test_an_absurd_number_of_walls_is_refused() -> None:
    boxes = MAX_SEGMENTS // 4 + 1
    text = "boxes:\n" + "  - {centre: [0, 0], size: [1, 1]}\n" * boxes
    with pytest.raises(AssignmentError, match=f"{4 * boxes} walls and circles: at most 3000 are"):
        parse_world(text)


def test_an_absurd_number_of_moving_obstacles_is_refused() -> None:
    one = "  - {circle: {radius: 1}, path: [{at: 0 s, pose: [0, 0]}]}\n"
    with pytest.raises(
        AssignmentError, match=r"w.yaml:1: moving: 101 moving obstacles: at most 100"
    ):
        parse_world("moving:\n" + one * (MAX_MOVING + 1), Path("w.yaml"))


def test_a_given_value_that_the_world_does_not_have_is_refused() -> None:
    with pytest.raises(
        AssignmentError, match=r"no value 'wal_x' in this world. Did you mean 'wall_x'"
    ):
        read_world(WORLDS / "wall.yaml", {"wal_x": 1.0})


def test_a_missing_file_is_the_callers_mistake(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="No such file"):
        read_world(tmp_path / "none.yaml")


BLOCKED = """bounds: [-2, -2, 2, 2]
boxes:
  - {centre: [1, 0], size: [1, 1]}
circles:
  - {centre: [-1, 0], radius: 0.2}
moving:
  - {circle: {radius: 0.2}, path: [{at: 0 s, pose: [0, 1]}], appears: 1 s}
"""


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        (Pose(1.0, 0.1, 0.0), "w.yaml:3: boxes[0]: {robot} cannot be at (1, 0.1): this is there"),
        (Pose(0.45, 0.0, 0.0), "boxes[0]: {robot} cannot be at (0.45, 0): this is 0.05 m away"),
        (Pose(-1.0, 0.0, 0.0), "w.yaml:5: circles[0]: {robot} cannot be at (-1, 0)"),
        (Pose(0.0, 1.95, 0.0), "w.yaml:1: bounds: {robot} cannot be at (0, 1.95): this is 0.05 m"),
        (Pose(5.0, 0.0, 0.0), "bounds: {robot} cannot be at (5, 0): that is outside the bounds"),
    ],
)
def test_a_robot_cannot_start_inside_a_wall(pose: Pose, message: str) -> None:
    message = message.format(robot="a robot with radius 0.1 m")
    with pytest.raises(AssignmentError, match=re.escape(message)):
        parse_world(BLOCKED, Path("w.yaml")).check_start(pose, 0.1)


def test_a_robot_fits_beside_the_walls() -> None:
    world = parse_world(BLOCKED)
    world.check_start(Pose(0.0, 0.0, 0.0), 0.1)
    # The obstacle appears there later.
    assert world.obstruction(Pose(0.0, 1.0, 0.0), 0.1) is None


def test_the_extent_holds_everything() -> None:
    text = "circles: [{centre: [1, 1], radius: 0.5}]\nsegments: [[-1, 0, 0, 0]]\n"
    text += "moving: [{circle: {radius: 0.1}, path: [{at: 0 s, pose: [0, 3]}]}]"
    world = parse_world(text)
    assert world.extent() == pytest.approx((-1.0, 0.0, 1.5, 3.1))
    assert world.extent((-4.0, 9.0)) == pytest.approx((-4.0, 0.0, 1.5, 9.0))


POND = "turtles:\n  - name: turtle1\n  - {name: bob, pose: [1, 2, 90 deg]}\n"


def test_a_world_has_turtles_instead_of_a_robot() -> None:
    (first, at), (name, pose) = parse_world(POND).turtles
    assert (first, at.x_m, name, pose.x_m) == ("turtle1", pytest.approx(5.5444, abs=1e-3), "bob", 1)
    world = parse_world("values: {x: 3}\nturtles: [{name: a, pose: [$x, 1, 0 deg]}]")
    assert world.turtles[0][1].x_m == 3.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            POND + "start: [0, 0, 0 deg]\n",
            "w.yaml:4: start: a world has turtles or a robot, not both: leave 'start' or 'turtles' "
            "out",
        ),
        (
            "turtles:\n  - {name: a, pose: [12, 1, 0 deg]}\n",
            "w.yaml:2: turtles[0].pose: a cannot be at (12, 1): the walls of turtles are at 0 and "
            "11.09 m",
        ),
        (
            "turtles:\n  - name: a\n  - name: a\n",
            "w.yaml:3: turtles[1].name: 'a' stands twice (first in line 2)",
        ),
        ("turtles:\n  - name: 1a\n", "w.yaml:2: turtles[0].name: "),
    ],
)
def test_mistakes_in_a_world_with_turtles_have_one_error_each(text: str, message: str) -> None:
    with pytest.raises(AssignmentError) as caught:
        parse_world(text, Path("w.yaml"))
    assert str(caught.value).startswith(message)
    assert len(str(caught.value).splitlines()) == 1
