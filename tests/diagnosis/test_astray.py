"""Why a turtle went astray: a test for each explanation, with its name."""

from dataclasses import replace

from sim.motion import Pose
from sim.turtles.turtle import Jump, Velocity
from tests.checks.builder import at, declarations, failing, judge, text
from tests.checks.turtles import MIDDLE, moves, swim
from tests.diagnosis.test_standing import stands

X, Y = MIDDLE
CORNERS = [[X, Y], [X + 2, Y], [X + 2, Y + 2], [X, Y + 2]]
SQUARE = {"figure": CORNERS, "closed": True, "tolerance": "10 cm"}
POND = [("turtle1", Pose(5.0, 5.0, 0.0)), ("far", Pose(8.0, 2.0, 0.0))]


def test_command_ran_out():
    def script(turtles, time_s):
        return Velocity(1.0) if time_s == 0.0 else None

    found = text(judge("turtle.draws", swim(script, 5.0), **SQUARE))
    assert "it stopped by itself 1 time, 1 s after a command on `/turtle1/cmd_vel`" in found
    assert "timer" in found


def test_angle_in_degrees():
    def script(turtles, time_s):
        return Velocity(1.0, 0.0, 90.0) if time_s < 1.0 else Velocity()

    found = text(judge("turtle.draws", swim(script, 3.0), **SQUARE))
    assert "angular.z was 90 rad/s" in found
    assert "radians" in found

    def jump(turtles, time_s):
        if time_s == 0.0:
            turtles.teleport("turtle1", Jump(Pose(8.0, 8.0, 90.0)))

    assert "a heading of 90 rad" in failing("turtle.draws", swim(jump, 1.0), **SQUARE)


def test_hit_the_wall():
    run = swim(moves((2.0, 0.0, 5.0)))
    assert "a wall at (11.09" in failing("turtle.no_wall", run)
    assert "it ran into a wall" in failing("turtle.draws", run, **SQUARE)


def test_turns_for_ever():
    run = swim(moves((0.0, 3.0, 8.0)), placed=POND)
    assert "more than 2 times round on the spot" in failing("turtle.catches", run, prey=["far"])


def test_never_commanded():
    found = failing("turtle.draws", swim(lambda turtles, time_s: None, 1.0), **SQUARE)
    assert "`turtle1` drew no line" in found
    assert "/turtle1/cmd_vel" in found


def test_callback_hangs():
    def late(began_s):
        found = stands("self.kill.call(request)", began_s=began_s, seen_s=8.9)
        told = (*declarations(exiting_ns=at(9.5)), found)
        run = swim(moves((1.0, 0.0, 1.0)), 8.0, POND, declarations=told)
        messages = {topic: sent[:200] for topic, sent in run.messages.items()}
        return failing("turtle.catches", replace(run, messages=messages), prey=["far"])

    found = late(4.5)
    assert "`scan_callback` does not return: it is in line 19, `self.kill.call(request)`" in found
    assert "use call_async()" in found
    # What commands in its callback is not stuck there.
    assert "does not return" not in late(1.0)
