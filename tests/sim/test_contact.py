"""First contact, against closed forms, and no tunnelling, against dense sampling."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from sim.contact import RESOLUTION_M, TOUCH_M, ContactFinder
from sim.description import SimulatorOptions
from sim.motion import Pose, Twist, integrate
from sim.shapes import Body, Shape, box, circle, wall
from sim.simulation import Simulation, Step
from sim.world import World, parse_world

RADIUS_M = 0.1
NUMBER = st.floats(-3.0, 3.0).map(lambda x: round(x, 4))
SHAPE = st.one_of(
    st.builds(
        lambda x, y, a, b: wall("w", x, y, x + a, y + b),
        NUMBER,
        NUMBER,
        st.floats(0.001, 3.0),
        st.floats(-3.0, 3.0),
    ),
    st.builds(lambda x, y, r: circle("c", x, y, r), NUMBER, NUMBER, st.floats(0.001, 1.0)),
    st.builds(
        lambda x, y, a, b, yaw: box("b", Pose(x, y, yaw), (a, b)),
        NUMBER,
        NUMBER,
        st.floats(0.001, 2.0),
        st.floats(0.001, 2.0),
        st.floats(-3.0, 3.0),
    ),
)
SHAPES = st.lists(SHAPE, min_size=1, max_size=6)


def world_of(shapes: list[Shape]) -> World:
    return World(tuple(replace(item, label=f"{item.label}{i}") for i, item in enumerate(shapes)))


def share(world: World, v: float, w: float, t: float, yaw: float = 0.0) -> float:
    return ContactFinder(world, RADIUS_M).find(Pose(0.0, 0.0, yaw), v, w, t, 0).share


@given(st.floats(-1.3, 1.3), st.floats(0.5, 3.0))
def test_contact_with_a_wall_is_where_a_straight_path_meets_it(yaw: float, x_m: float) -> None:
    """A wall at x = d is touched after (d - r) / cos(yaw)."""
    expected_m = (x_m - RADIUS_M) / math.cos(yaw)
    far = world_of([wall("w", x_m, -1000.0, x_m, 1000.0)])
    travelled_m = 20.0 * share(far, 20.0, 0.0, 1.0, yaw)
    assert travelled_m == pytest.approx(expected_m, abs=3 * RESOLUTION_M / math.cos(yaw))


@given(st.floats(0.3, 3.0), st.floats(0.05, 0.95))
def test_contact_on_an_arc_is_where_the_circle_meets_the_wall(turn_m: float, part: float) -> None:
    """A left turn of radius R meets the wall y = d after the angle acos(1 - (d - r) / R)."""
    y_m = RADIUS_M + part * 2.0 * turn_m
    angle = math.acos(1.0 - (y_m - RADIUS_M) / turn_m)
    found = share(world_of([wall("w", -10.0, y_m, 10.0, y_m)]), turn_m, 1.0, math.pi)
    # Depth grows with sin(angle) along the way.
    assert found * math.pi == pytest.approx(angle, abs=1e-8 / turn_m / math.sin(angle) + 1e-9)


@given(SHAPES, st.floats(-100.0, 100.0), st.floats(-20.0, 20.0))
@settings(max_examples=200)
def test_nothing_is_tunnelled_through(shapes: list[Shape], v: float, w: float) -> None:
    """However fast, no sample of the way made is deeper in a wall than 1 nm; and it ends near."""
    world = world_of(shapes)
    assume(world.obstruction(Pose(0.0, 0.0, 0.0), RADIUS_M + 1e-3) is None)
    start, dt_s = Pose(0.0, 0.0, 0.0), 0.05
    found = ContactFinder(world, RADIUS_M).find(start, v, w, dt_s, 0)
    for i in range(401):
        pose = integrate(start, v, w, dt_s * found.share * i / 400)
        clear_m = min(shape.clearance_m(pose.x_m, pose.y_m) for shape in world.shapes)
        assert clear_m - RADIUS_M >= -RESOLUTION_M - 1e-12
    if found.share < 1.0:
        assert found.label is not None
        assert clear_m - RADIUS_M <= 3 * RESOLUTION_M


@given(SHAPES, st.lists(st.tuples(st.floats(-2, 2), st.floats(-5, 5)), min_size=1, max_size=40))
@settings(max_examples=60, deadline=None)
def test_what_the_finder_remembers_never_changes_a_result(
    shapes: list[Shape], commands: list[tuple[float, float]]
) -> None:
    world = world_of(shapes)
    pose = Pose(0.0, 0.0, 0.0)
    assume(world.obstruction(pose, RADIUS_M) is None)
    finder = ContactFinder(world, RADIUS_M)
    for v, w in commands:
        found = finder.find(pose, v, w, 0.05, 0)
        assert found == ContactFinder(world, RADIUS_M).find(pose, v, w, 0.05, 0)
        pose = integrate(pose, v, w, 0.05 * found.share)


def standing(world: World, start: Pose) -> Simulation:
    pose = [start.x_m, start.y_m, f"{start.yaw_rad} rad"]
    options = SimulatorOptions.model_validate({"robot": {"pose": pose}})
    return Simulation(world, options, (0,), Body("", start, RADIUS_M))


def drive(world: World, command: Twist, steps: int, start: Pose) -> Simulation:
    simulation = standing(world, start)
    simulation.advance(command)
    for _ in range(steps - 1):
        simulation.advance()
    return simulation


ROOM = parse_world("bounds: [-1, -1, 1, 1]")


def test_a_robot_that_pushes_against_a_wall_stays_to_the_last_bit() -> None:
    simulation = drive(ROOM, Twist(0.22, 0.0), 1000, Pose(0.0, 0.0, 0.3))
    before = simulation.pose
    for _ in range(100):
        step = simulation.advance()
        assert step.pose == before
        assert step.twist == Twist(0.0, 0.0)
        assert step.contact == "bounds"


def test_a_robot_can_turn_and_leave_a_wall() -> None:
    simulation = drive(ROOM, Twist(0.22, 0.0), 600, Pose(0.0, 0.0, 0.0))
    assert simulation.pose.x_m == pytest.approx(0.9, abs=1e-8)
    turned = drive_on(simulation, Twist(0.0, 1.0), 200)
    assert turned.pose.x_m == pytest.approx(0.9, abs=1e-8)
    assert turned.pose.yaw_rad > 1.5
    left = drive_on(simulation, Twist(0.2, 1.0), 100)
    assert left.contact is None
    assert left.pose.x_m < 0.85


def drive_on(simulation: Simulation, command: Twist, steps: int) -> Step:
    step = simulation.advance(command)
    for _ in range(steps - 1):
        step = simulation.advance()
    return step


def test_a_robot_that_drives_along_a_wall_it_touches_is_not_held() -> None:
    """It touches all the time, and is stopped only by the wall at the end."""
    along = drive(ROOM, Twist(0.1, 0.0), 200, Pose(-0.5, 0.9, 0.0))
    assert along.pose.x_m == pytest.approx(-0.5 + 0.1 * 2.0, abs=0.006)
    assert along.advance().contact == "bounds"
    assert along.pose.y_m == 0.9


def test_an_obstacle_that_moves_onto_the_robot_touches_it_but_does_not_move_it() -> None:
    world = parse_world(
        "moving:\n- circle: {radius: 0.2}\n"
        "  path: [{at: 0 s, pose: [1, 0]}, {at: 1 s, pose: [0, 0]}]"
    )
    simulation = standing(world, Pose(0.0, 0.0, 0.0))
    steps = [simulation.advance() for _ in range(120)]
    touched = [step.contact == "moving[0]" for step in steps]
    # The centres are 0.3 m apart after 0.7 s.
    assert touched.index(True) == pytest.approx(69, abs=1)
    assert all(touched[71:])
    assert {step.pose for step in steps} == {Pose(0.0, 0.0, 0.0)}


def test_a_robot_that_something_stands_on_may_leave_but_not_go_deeper() -> None:
    world = parse_world("moving: [{circle: {radius: 0.2}, path: [{at: 0 s, pose: [0.25, 0]}]}]")
    assert drive(world, Twist(0.2, 0.0), 50, Pose(0.0, 0.0, 0.0)).pose.x_m == 0.0
    left = drive(world, Twist(-0.2, 0.0), 100, Pose(0.0, 0.0, 0.0))
    assert left.pose.x_m == pytest.approx(-0.18, abs=0.01)
    assert left.advance().contact is None


def test_a_moving_box_touches_a_robot_that_is_inside_it() -> None:
    world = parse_world(
        "moving: [{box: {size: [2, 2]}, path: [{at: 0 s, pose: [0, 0]}], appears: 100 ms}]"
    )
    simulation = standing(world, Pose(0.0, 0.0, 0.0))
    contacts = [simulation.advance().contact for _ in range(12)]
    assert contacts == [None] * 9 + ["moving[0]"] * 3


def test_a_robot_that_is_nearer_than_a_micrometre_touches() -> None:
    for gap_m, label in ((2.0 * TOUCH_M, None), (0.5 * TOUCH_M, "w0")):
        x_m = RADIUS_M + gap_m
        finder = ContactFinder(world_of([wall("w", x_m, -1, x_m, 1)]), RADIUS_M)
        assert finder.find(Pose(0.0, 0.0, 0.0), 0.0, 0.0, 0.01, 0).label == label
