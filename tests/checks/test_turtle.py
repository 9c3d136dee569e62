"""The checks of turtles, on runs of the real simulation core."""

import math

import pytest

from grader.findings.finding import Status
from grader.measure.turtle.drawing import drawn
from grader.recording.interaction import Asked
from grader.recording.window import cut
from sim.motion import Pose
from sim.turtles.turtle import Jump, Pen, Velocity
from tests.checks.builder import at, failing, judge
from tests.checks.turtles import MIDDLE, moves, swim

X, Y = MIDDLE
SQUARE = [[X, Y], [X + 2, Y], [X + 2, Y + 2], [X, Y + 2]]
# 16 ms divide neither 2 s nor a right angle at 1 rad/s.
LEG, TURN = (1.0, 0.0, 2.0), (0.0, math.pi / 2 / 1.584, 1.584)
FOUR = moves(LEG, TURN, LEG, TURN, LEG, TURN, LEG)


def requests(service, *names):
    return tuple(Asked(service, "", {"name": name}, at(2.0)) for name in names)


def figure(**changes):
    return {"figure": SQUARE, "closed": True, "tolerance": "10 cm", **changes}


def test_a_square_has_its_sides_corners_and_end():
    run = swim(FOUR)
    assert judge("turtle.draws", run, **figure()).status is Status.PASSED
    assert judge("turtle.corners", run, number=4).status is Status.PASSED
    assert judge("turtle.closes", run).status is Status.PASSED
    assert judge("turtle.no_wall", run).status is Status.PASSED
    (line,) = drawn(run)
    assert len(line.points) == 5
    assert line.length_m == pytest.approx(8.0)


def test_a_part_of_a_figure_gives_its_share():
    run = swim(moves(LEG, TURN, LEG))
    found = judge("turtle.draws", run, **figure())
    assert (found.status, found.credit) == (Status.FAILED, pytest.approx(0.55, abs=0.03))
    assert "of the figure" in found.observed
    assert "2 corners" not in failing("turtle.corners", run, number=4)
    assert "away" in failing("turtle.closes", run)


def test_a_line_beside_the_figure_is_told_with_its_place():
    run = swim(moves(LEG, TURN, LEG, TURN, LEG, TURN, (1.0, 0.0, 4.0)))
    found = failing("turtle.draws", run, **figure())
    assert f"at ({X:.2f}, {Y - 2:.2f}) m it is 2 m off the figure" in found


def test_an_angle_that_is_off_is_told():
    run = swim(moves(LEG, (0.0, 1.0, 1.0), LEG))
    assert "turns by 58°" in failing("turtle.corners", run, number=1)


def test_teleports_draw_unless_they_must_not():
    def script(turtles, time_s):
        if time_s == 0.0:
            for x, y in (*SQUARE[1:], SQUARE[0]):
                turtles.teleport("turtle1", Jump(Pose(x, y, 0.0)))

    run = swim(script, 1.0)
    assert judge("turtle.draws", run, **figure()).status is Status.PASSED
    assert "a teleport drew" in failing("turtle.draws", run, **figure(teleports=False))


def test_pens_are_told_apart_by_the_length_of_their_lines():
    def script(turtles, time_s):
        if time_s == 1.008:
            turtles.set_pen("turtle1", Pen((255, 0, 0), 7))
        return Velocity(1.0) if time_s < 2.0 else Velocity()

    run = swim(script, 3.0)
    red = {"colour": [255, 0, 0], "width": 7}
    assert judge("turtle.pen", run, **red, share="40 %").status is Status.PASSED
    found = failing("turtle.pen", run, **red)
    assert "1.01 m with the colour [179, 184, 255] and 3 pixels of width" in found


def test_nothing_is_drawn_with_the_pen_up_and_after_a_clear():
    def lifted(turtles, time_s):
        turtles.set_pen("turtle1", Pen(is_down=False))
        return Velocity(1.0)

    assert "its pen is up" in failing("turtle.draws", swim(lifted, 1.0), **figure())

    def cleared(turtles, time_s):
        if time_s == 1.6:
            turtles.clear()
        return Velocity(1.0) if time_s < 2.0 else Velocity()

    (line,) = drawn(swim(cleared, 3.0))
    assert line.points[0] == (pytest.approx(X + 1.6), Y)


def test_what_was_drawn_before_a_window_is_not_in_it():
    run = swim(FOUR)
    inside = cut(run, at(1.0 + 2.0 + 1.584), at(1.0 + 4.0 + 1.584))
    (line,) = drawn(inside)
    assert line.points[0] == (pytest.approx(X + 2.0), pytest.approx(Y, abs=0.05))


def hunter(names, near=0.3):
    """Drives to turtles in an order, turning on the spot, and kills each when it is so near."""
    left = list(names)

    def script(turtles, time_s):
        me = turtles.turtles["turtle1"].pose
        if not left or time_s < 0.1:
            return Velocity()
        prey = turtles.turtles[left[0]].pose
        if math.hypot(prey.x_m - me.x_m, prey.y_m - me.y_m) < near:
            turtles.kill(left.pop(0))
            return Velocity()
        bearing = math.atan2(prey.y_m - me.y_m, prey.x_m - me.x_m)
        error = math.remainder(bearing - me.yaw_rad, math.tau)
        return Velocity(2.0 if abs(error) < 0.1 else 0.0, 0.0, 4.0 * error)

    return script


POND = [
    ("turtle1", Pose(5.0, 5.0, 0.0)),
    ("near", Pose(6.0, 6.0, 0.0)),
    ("far", Pose(8.0, 2.0, 0.0)),
]
PREY = {"prey": ["near", "far"], "within": "50 cm"}


def test_the_nearest_is_caught_first():
    run = swim(hunter(["near", "far"]), 15.0, POND)
    assert judge("turtle.catches", run, **PREY, order="nearest").status is Status.PASSED
    assert judge("turtle.catches", run, **PREY, order="listed").status is Status.PASSED


def test_another_order_is_told():
    run = swim(hunter(["far", "near"]), 15.0, POND)
    assert judge("turtle.catches", run, **PREY).status is Status.PASSED
    found = failing("turtle.catches", run, **PREY, order="nearest")
    assert "`far`, 4.24 m away, was hunted before `near`, 1.41 m away" in found
    assert "`far` was killed before `near`" in failing(
        "turtle.catches", run, **PREY, order="listed"
    )


def test_a_kill_from_afar_does_not_count():
    found = failing("turtle.catches", swim(hunter(["near", "far"], 9.0), 1.0, POND), **PREY)
    assert "`near` was killed when `turtle1` was 1.41 m away" in found


def test_who_is_left_is_told_and_the_others_count():
    run = swim(hunter(["near"]), 10.0, POND)
    found = judge("turtle.catches", run, **PREY)
    assert (found.status, found.credit) == (Status.FAILED, 0.5)
    assert "1 of 2 turtles killed; not `far`" in found.observed


def test_who_is_reached_and_not_killed_is_told():
    def script(turtles, time_s):
        return Velocity(1.0) if time_s < 1.0 else Velocity()

    pond = [("turtle1", Pose(5.0, 5.0, 0.0)), ("near", Pose(6.2, 5.0, 0.0))]
    found = failing("turtle.catches", swim(script, 4.0, pond), prey=["near"])
    assert "although `turtle1` was at `near` at the end" in found


def test_spawned_turtles_are_at_their_places():
    def script(turtles, time_s):
        if time_s == 0.16:
            turtles.spawn(Pose(2.0, 3.0, 0.0), "bob")

    run = swim(script, 1.0, asked=requests("/spawn", "bob", "/amy"))
    assert judge("turtle.spawns", run, turtles={"bob": [2, 3]}).status is Status.PASSED
    assert "1 m off" in failing("turtle.spawns", run, turtles={"bob": [2, 2]})
    found = judge("turtle.spawns", run, turtles={"bob": [2, 3], "amy": [1, 1]})
    assert (found.credit, found.observed) == (0.5, "no `amy`: only `bob`; not spawned: `/amy`")


def test_who_never_asks_for_a_turtle_is_told_why():
    found = failing("turtle.spawns", swim(moves(LEG)), turtles={"bob": [2, 3]})
    assert "no `bob`: `/bot_publisher` created no client" in found


def test_kills_in_vain_are_told_with_their_name():
    asked = requests("/kill", *["near"] * 3)
    run = swim(hunter(["near"]), 10.0, POND, asked=asked)
    found = judge("turtle.catches", run, **PREY).observed
    assert "not `far`, in 3 requests to `/kill`, the last with the name `near`" in found


def test_a_hunter_must_not_be_teleported_where_that_is_asked_for():
    def script(turtles, time_s):
        if time_s == 0.16:
            turtles.teleport("turtle1", Jump(Pose(6.2, 5.0, 0.0)))
            turtles.kill("near")

    run = swim(script, 1.0, POND)
    assert judge("turtle.catches", run, prey=["near"]).status is Status.PASSED
    found = failing("turtle.catches", run, prey=["near"], teleports=False)
    assert "`turtle1` was teleported" in found
