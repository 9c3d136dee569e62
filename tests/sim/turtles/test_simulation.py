"""Turtles without ROS: what turtlesim does, and what it does not bear."""

from __future__ import annotations

import math

import pytest

from sim.motion import NS, Pose
from sim.turtles.bounds import CENTRE_M, SIZE_M
from sim.turtles.canvas import EMPTY
from sim.turtles.simulation import Act, Step, Turtles
from sim.turtles.turtle import STEP_NS, Jump, Outcome, Pen, Velocity

RED = Pen((255, 0, 0), 3)


def advance(turtles: Turtles, seconds: float) -> list[Step]:
    return [turtles.advance() for _ in range(round(seconds * NS / STEP_NS))]


def test_the_first_turtle_is_in_the_middle_and_looks_to_the_right() -> None:
    turtles = Turtles()
    step = turtles.advance()
    assert step.turtles["turtle1"].pose == Pose(CENTRE_M, CENTRE_M, 0.0)
    assert [(one.act, one.turtle) for one in step.events] == [(Act.PLACED, "turtle1")]
    assert pytest.approx(11.088889, abs=1e-6) == SIZE_M


def test_a_command_acts_for_a_second() -> None:
    turtles = Turtles()
    turtles.command("turtle1", Velocity(ahead_m_s=1.0))
    steps = advance(turtles, 2.0)
    # 63 steps of 16 ms begin at most a second after the command.
    assert steps[-1].turtles["turtle1"].pose.x_m == pytest.approx(CENTRE_M + 63 * 0.016)
    ends = [one for step in steps for one in step.events if one.act is Act.COMMAND_TIMEOUT]
    assert len(ends) == 1


def test_a_turtle_turns_before_it_moves_and_its_heading_stays_in_range() -> None:
    turtles = Turtles()
    for _ in range(400):
        turtles.command("turtle1", Velocity(turn_rad_s=2.0))
        yaw_rad = turtles.advance().turtles["turtle1"].pose.yaw_rad
        assert -math.pi <= yaw_rad < math.pi


def test_walls_hold_a_turtle() -> None:
    turtles = Turtles([("bob", Pose(11.0, 1.0, 0.0))])
    turtles.command("bob", Velocity(ahead_m_s=1.0))
    last = advance(turtles, 0.5)[-1].turtles["bob"]
    assert (last.pose.x_m, last.pose.y_m, last.hits_wall) == (SIZE_M, 1.0, True)


def test_the_pen_draws_where_the_turtle_was_and_the_sensor_sees_it() -> None:
    turtles = Turtles()
    turtles.set_pen("turtle1", RED)
    turtles.command("turtle1", Velocity(ahead_m_s=1.0))
    advance(turtles, 1.0)
    assert turtles.canvas.colour((CENTRE_M + 0.5, CENTRE_M)) == (255, 0, 0)
    assert turtles.canvas.colour((CENTRE_M - 0.5, CENTRE_M)) == EMPTY
    turtles.set_pen("turtle1", Pen(is_down=False))
    turtles.teleport("turtle1", Jump(Pose(1.0, 1.0, 0.0)))
    last = turtles.advance()
    assert last.turtles["turtle1"].colour == EMPTY
    assert last.events[0].pen == Pen((255, 0, 0), 3, is_down=False)
    turtles.clear()
    assert turtles.canvas.colour((CENTRE_M + 0.5, CENTRE_M)) == EMPTY


def test_teleports_turn_first_and_draw_a_line() -> None:
    turtles = Turtles()
    turtles.teleport("turtle1", Jump(Pose(0.0, 0.0, math.pi / 2), ahead_m=2.0))
    turtles.teleport("turtle1", Jump(Pose(8.0, 20.0, 1.0)))
    step = turtles.advance()
    landed = [one.pose for one in step.events if one.act is Act.TELEPORTED]
    assert landed[0] == Pose(CENTRE_M, CENTRE_M + 2.0, math.pi / 2)
    assert landed[1] == step.turtles["turtle1"].pose == Pose(8.0, SIZE_M, 1.0)
    assert turtles.canvas.colour((CENTRE_M, CENTRE_M + 1.0)) == Pen().colour


def test_turtles_are_spawned_killed_and_reset() -> None:
    turtles = Turtles()
    # turtlesim counts on, where a name is taken.
    assert turtles.spawn(Pose(1.0, 1.0, 0.0), "turtle2") == "turtle2"
    assert turtles.spawn(Pose(1.0, 1.0, 0.0), "turtle2") == ""
    assert turtles.spawn(Pose(2.0, 2.0, 0.0)) == "turtle3"
    assert turtles.kill("turtle2")
    assert not turtles.kill("turtle2")
    assert turtles.advance().turtles.keys() == {"turtle1", "turtle3"}
    turtles.reset()
    assert turtles.advance().turtles.keys() == {"turtle1"}


def test_a_rotation_ends_at_its_heading_or_by_a_command() -> None:
    turtles = Turtles()
    goal = turtles.rotate("turtle1", -1.0)
    assert goal is not None
    last = advance(turtles, 1.5)[-1].turtles["turtle1"]
    assert goal.outcome is Outcome.SUCCEEDED
    assert last.pose.yaw_rad == pytest.approx(-1.0, abs=0.02)
    assert goal.delta_rad == pytest.approx(1.0, abs=0.02)
    again = turtles.rotate("turtle1", 2.0)
    newer = turtles.rotate("turtle1", 2.5)
    assert again is not None and newer is not None
    assert again.outcome is Outcome.ABORTED
    turtles.command("turtle1", Velocity())
    assert newer.outcome is Outcome.ABORTED
    third = turtles.rotate("turtle1", 3.0)
    assert third is not None
    third.is_canceling = True
    turtles.advance()
    assert third.outcome is Outcome.CANCELED


@pytest.mark.parametrize("wrong", [math.nan, math.inf, 1e300])
def test_no_number_spoils_a_turtle(wrong: float) -> None:
    turtles = Turtles()
    turtles.command("turtle1", Velocity(turn_rad_s=wrong))
    assert Act.COMMAND_REJECTED in [one.act for one in turtles.advance().events]
    if not math.isfinite(wrong):
        turtles.teleport("turtle1", Jump(Pose(wrong, 0.0, 0.0)))
        assert turtles.spawn(Pose(0.0, wrong, 0.0)) == ""
        assert turtles.rotate("turtle1", wrong) is None
    assert turtles.advance().turtles["turtle1"].pose == Pose(CENTRE_M, CENTRE_M, 0.0)
