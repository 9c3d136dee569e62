"""Several robots in one world: they see and touch each other, and each is named in what it says."""

from __future__ import annotations

import math

import pytest

from grader.errors import AssignmentError
from sim.description import RobotOptions, SimulatorOptions
from sim.motion import Pose, Twist
from sim.robot import BURGER
from sim.simulation import EventKind, Simulation, make_simulation, make_simulations
from sim.world import parse_world

WORLD = parse_world("{}")
OPTIONS = SimulatorOptions()


def robots(**poses: Pose) -> dict[str, Simulation]:
    own = {name: RobotOptions(pose=[p.x_m, p.y_m, f"{p.yaw_rad} rad"]) for name, p in poses.items()}
    return make_simulations(WORLD, OPTIONS.each(own), seed=3)


def test_robots_see_each_other_where_they_are_now() -> None:
    pair = robots(tb1=Pose(0.0, 0.0, 0.0), tb2=Pose(1.0, 0.0, math.pi))
    for _ in range(100):
        pair["tb1"].advance()
        pair["tb2"].advance(Twist(-0.2, 0.0))
    one, other = pair["tb1"], pair["tb2"]
    assert other.pose.x_m > 1.1
    ranges = one.lidar.cast(one.pose, one.time_ns)
    assert ranges[0] == pytest.approx(other.pose.x_m - BURGER.radius_m)
    assert math.isinf(ranges[90])


def test_a_robot_that_drives_into_another_stops_there_and_both_touch() -> None:
    pair = robots(tb1=Pose(0.0, 0.0, 0.0), tb2=Pose(0.5, 0.0, 0.0))
    for _ in range(300):
        steps = {name: one.advance(Twist(0.2, 0.0) if name == "tb1" else None)
                 for name, one in pair.items()}  # fmt: skip
    assert pair["tb1"].pose.x_m == pytest.approx(0.5 - 2 * BURGER.radius_m, abs=1e-6)
    assert steps["tb1"].contact == "robots[tb2]"
    assert steps["tb2"].contact == "robots[tb1]"


def test_a_robot_that_starts_in_another_is_refused_by_name() -> None:
    with pytest.raises(AssignmentError, match=r"robots\[tb2\]|cannot be at \(0, 0\)"):
        robots(tb1=Pose(0.0, 0.0, 0.0), tb2=Pose(0.15, 0.0, 0.0))


def test_the_first_of_several_is_as_it_would_be_alone() -> None:
    options = SimulatorOptions.model_validate(
        {"lidar": {"noise": "1 cm"}, "odometry": {"drift": {"slip": "1 cm"}}}
    )
    world = parse_world("circles: [{centre: [2, 0], radius: 0.2}]")
    far = {"tb1": RobotOptions(), "tb2": RobotOptions(pose=[50, 50, "0 deg"])}
    pair, alone = make_simulations(world, options.each(far), 7), make_simulation(world, options, 7)
    for _ in range(60):
        own, step = pair["tb1"].advance(Twist(0.2, 0.1)), alone.advance(Twist(0.2, 0.1))
        assert (own.pose, own.odometry) == (step.pose, step.odometry)
        if step.scan is not None and own.scan is not None:
            assert (own.scan.ranges_m == step.scan.ranges_m).all()


def test_two_robots_have_noise_of_their_own() -> None:
    options = SimulatorOptions.model_validate({"lidar": {"noise": "1 cm"}})
    own = {"tb1": RobotOptions(pose=[0, 0, "0 deg"]), "tb2": RobotOptions(pose=[0, 9, "0 deg"])}
    world = parse_world("boxes: [{centre: [1, 0], size: [0.1, 99]}]")
    pair = make_simulations(world, options.each(own), 7)
    scans = {name: [one.advance().scan for _ in range(20)][-1] for name, one in pair.items()}
    assert scans["tb1"] is not None and scans["tb2"] is not None
    assert (scans["tb1"].ranges_m[:20] != scans["tb2"].ranges_m[:20]).all()


def test_topics_and_frames_begin_with_the_name_and_transforms_are_shared() -> None:
    each = OPTIONS.each({"tb1": RobotOptions(), "tb2": RobotOptions(model="waffle")})
    assert each["tb1"].topics.command.topic == "/tb1/cmd_vel"
    assert each["tb2"].topics.scan.topic == "/tb2/scan"
    assert {one.topics.tf.topic for one in each.values()} == {"/tf"}
    assert each["tb1"].transforms == {
        ("tb1/odom", "tb1/base_footprint"),
        ("tb1/base_footprint", "tb1/base_link"),
        ("tb1/base_link", "tb1/base_scan"),
    }
    assert OPTIONS.each({}) == {"": OPTIONS}


def test_what_a_robot_meets_is_an_event_of_its_own() -> None:
    pair = robots(tb1=Pose(0.0, 0.0, 0.0), tb2=Pose(0.5, 0.0, 0.0))
    events = []
    for _ in range(300):
        events += pair["tb1"].advance(Twist(0.2, 0.0)).events
        pair["tb2"].advance()
    assert [(event.kind, event.text) for event in events] == [
        (EventKind.CONTACT_BEGAN, "robots[tb2]")
    ]
