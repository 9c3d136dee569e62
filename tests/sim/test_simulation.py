"""The stepping core: determinism, sensors on time, commands."""

from __future__ import annotations

import math
import random
import struct
from collections.abc import Callable
from dataclasses import astuple
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.errors import AssignmentError
from sim.description import LidarOptions, SimulatorOptions
from sim.motion import REST, Pose, Twist
from sim.simulation import STEP_NS, EventKind, Schedule, Simulation, Step, make_simulation
from sim.world import World, parse_world, read_world

WORLDS = Path(__file__).parent / "worlds"
ROOM = read_world(WORLDS / "room.yaml")
EMPTY = World()
Commands = Callable[[int], Twist | None]


def simulation(world: World = EMPTY, seed: int = 0, **options: object) -> Simulation:
    return make_simulation(world, SimulatorOptions.model_validate(options), seed)


def run(subject: Simulation, steps: int, commands: Commands = lambda _: None) -> list[Step]:
    return [subject.advance(commands(i)) for i in range(steps)]


def recorded(steps: list[Step]) -> bytes:
    """Every bit of every number that a recording would hold."""
    parts = []
    for step in steps:
        pose, twist, command = step.pose, step.twist, step.command
        numbers = [*astuple(pose), *astuple(twist), *astuple(command)]
        if step.odometry is not None:
            numbers += astuple(step.odometry.pose)
        parts.append(struct.pack(f"<{len(numbers)}d", *numbers))
        parts.append(f"{step.index} {step.time_ns} {step.contact} {step.events}".encode())
        if step.scan is not None:
            parts.append(step.scan.ranges_m.tobytes())
    return b"".join(parts)


NOISY = {
    "lidar": {"noise": "1 cm"},
    "odometry": {"drift": {"radius": "1 %", "separation": "1 %", "slip": "2 mm"}},
}


def wild(seed: int) -> Commands:
    source = random.Random(seed)
    return lambda _: (
        Twist(source.uniform(-0.3, 0.3), source.uniform(-3.0, 3.0))
        if source.random() < 0.05
        else None
    )


def test_equal_seeds_and_commands_give_equal_bits() -> None:
    first = recorded(run(simulation(ROOM, 5, **NOISY), 2000, wild(1)))
    assert recorded(run(simulation(ROOM, 5, **NOISY), 2000, wild(1))) == first


def test_another_seed_changes_the_sensors_but_not_the_truth() -> None:
    first = run(simulation(ROOM, 5, **NOISY), 500, wild(1))
    second = run(simulation(ROOM, 6, **NOISY), 500, wild(1))
    assert [step.pose for step in first] == [step.pose for step in second]
    assert recorded(first) != recorded(second)


def test_the_noise_of_a_scan_does_not_depend_on_odometry() -> None:
    quiet = {"lidar": NOISY["lidar"], "odometry": {"enabled": False}}
    first = run(simulation(ROOM, 5, **NOISY), 300, wild(1))
    second = run(simulation(ROOM, 5, **quiet), 300, wild(1))
    for one, other in zip(first, second, strict=True):
        if one.scan is not None and other.scan is not None:
            assert one.scan.ranges_m.tobytes() == other.scan.ranges_m.tobytes()


def test_a_robot_at_rest_stays_at_rest_to_the_last_bit() -> None:
    subject = simulation(ROOM, robot={"pose": [0.1, 0.2, "0.3 rad"]})
    for step in run(subject, 1000, lambda i: REST if i % 7 == 0 else None):
        assert step.pose == Pose(0.1, 0.2, 0.3)
        assert step.twist == REST
        if step.odometry is not None:
            assert step.odometry.pose == Pose(0.1, 0.2, 0.3)


def due_ms(rate: float, seconds: int = 10, **window: str) -> list[int]:
    """When scans are due; the steps are 10 ms long."""
    schedule = Schedule(LidarOptions.model_validate({"rate": f"{rate} Hz", **window}))
    found = []
    for step in range(1, 100 * seconds + 1):
        expected = schedule.next_ns
        if schedule.is_due(step * STEP_NS):
            assert step * STEP_NS == expected or window
            found.append(10 * step)
    return found


@given(st.integers(1, 100))
def test_no_rate_drifts_over_a_long_run(rate: int) -> None:
    assert len(due_ms(rate)) == 10 * rate


def test_thirty_hertz_comes_at_the_first_step_that_is_not_early() -> None:
    assert due_ms(30.0)[:6] == [40, 70, 100, 140, 170, 200]


def test_nothing_is_due_outside_its_window() -> None:
    assert due_ms(10.0, starts="300 ms", stops="600 ms") == [300, 400, 500]


def test_sensors_may_start_late_and_stop_early() -> None:
    steps = run(
        simulation(lidar={"starts": "1 s", "stops": "2 s"}, odometry={"enabled": False}), 300
    )
    assert [s.time_ns // STEP_NS for s in steps if s.scan is not None] == [100, 120, 140, 160, 180]
    assert all(step.odometry is None for step in steps)


def test_a_constant_command_draws_the_arc_of_the_closed_form() -> None:
    """From rest, v and w rise linearly and at their own rates; then it is a circle of v / w."""
    steps = run(simulation(), 1000, lambda i: Twist(0.2, 0.5) if i == 0 else None)
    settled = [step.pose for step in steps[50:]]
    first = settled[0]
    centre = complex(first.x_m, first.y_m) + 0.4j * complex(
        math.cos(first.yaw_rad), math.sin(first.yaw_rad)
    )
    for pose in settled:
        assert abs(complex(pose.x_m, pose.y_m) - centre) == pytest.approx(0.4, abs=1e-12)


def test_the_robot_obeys_its_own_drives_at_their_times() -> None:
    drives = [
        {"at": "500 ms", "linear": "0.1 m/s"},
        {"at": "100 ms", "angular": "1 rad/s"},
    ]
    steps = run(simulation(robot={"drives": drives}), 100)
    asked = [(step.command.linear_m_s, step.command.angular_rad_s) for step in steps]
    # The step that begins at 100 ms is the eleventh.
    assert asked == [(0.0, 0.0)] * 10 + [(0.0, 1.0)] * 40 + [(0.1, 0.0)] * 50


def test_with_a_timeout_the_robot_stops_and_it_is_reported_once() -> None:
    subject = simulation(robot={"command_timeout": "500 ms"})
    steps = run(subject, 300, lambda i: Twist(0.1, 0.0) if i in (0, 30) else None)
    told = [
        step.index
        for step in steps
        for event in step.events
        if event.kind is EventKind.COMMAND_TIMEOUT
    ]
    assert told == [81]  # the command came before step 31, which ends at 310 ms
    assert steps[79].command == Twist(0.1, 0.0)
    assert steps[-1].command == steps[-1].twist == REST
    assert subject.advance(Twist(0.1, 0.0)).command == Twist(0.1, 0.0)


@pytest.mark.parametrize(
    "command",
    [Twist(math.nan, 0.0), Twist(0.0, math.nan), Twist(math.inf, 0.0), Twist(0.1, -math.inf)],
)
def test_a_command_that_is_not_finite_stops_the_robot_and_is_reported(command: Twist) -> None:
    subject = simulation()
    run(subject, 100, lambda i: Twist(0.2, 1.0) if i == 0 else None)
    step = subject.advance(command)
    assert [event.kind for event in step.events] == [EventKind.COMMAND_REJECTED]
    assert step.events[0].text == (f"linear {command.linear_m_s}, angular {command.angular_rad_s}")
    assert step.command == REST
    last = run(subject, 100)[-1]
    assert last.twist == REST
    assert math.isfinite(last.pose.x_m)
    assert run(subject, 50, lambda _: Twist(0.1, 0.0))[-1].twist == Twist(0.1, 0.0)


def test_beginning_and_end_of_a_contact_are_reported() -> None:
    world = parse_world("segments: [[0.3, -1, 0.3, 1]]")
    subject = simulation(world)
    steps = run(subject, 300, {0: Twist(0.2, 0), 200: Twist(-0.2, 0)}.get)
    events = [(event.kind, event.text) for step in steps for event in step.events]
    assert events == [
        (EventKind.CONTACT_BEGAN, "segments[0]"),
        (EventKind.CONTACT_ENDED, "segments[0]"),
    ]
    touching = [step for step in steps if step.contact == "segments[0]"]
    assert len({step.pose for step in touching}) == 1
    assert touching[0].pose.x_m == pytest.approx(0.2, abs=1e-8)


def test_the_options_change_the_robot() -> None:
    options = {
        "model": "waffle",
        "radius": "30 cm",
        "max_speed": "1 m/s",
        "max_angular_speed": "90 deg/s",
        "max_acceleration": "2 m/s^2",
        "max_angular_acceleration": "4 rad/s^2",
    }
    model = simulation(robot=options).model
    assert (model.name, model.radius_m, model.wheel_separation_m) == ("waffle", 0.3, 0.287)
    limits = model.limits
    assert (limits.speed_m_s, limits.angular_speed_rad_s) == (1.0, pytest.approx(math.pi / 2))
    assert (limits.acceleration_m_s2, limits.angular_acceleration_rad_s2) == (2.0, 4.0)


def test_the_start_is_that_of_the_scenario_or_else_of_the_world() -> None:
    assert simulation(ROOM).pose == Pose(-1.5, 0.0, 0.0)
    assert simulation(ROOM, robot={"pose": [0, 0, "1 rad"]}).pose == Pose(0.0, 0.0, 1.0)


def test_a_robot_inside_a_wall_is_refused() -> None:
    with pytest.raises(AssignmentError, match=r"room.yaml:8: boxes\[0\]: a robot with radius"):
        simulation(ROOM, robot={"pose": [0, 1.2, 0]})


@pytest.mark.parametrize("drift", [{}, {"slip": "1 mm"}])
def test_a_push_moves_the_robot_on_its_way_and_odometry_shows_it(drift: dict[str, str]) -> None:
    push = {"after": "20 cm", "ahead": "-10 cm", "turn": "30 deg", "lasts": "500 ms"}
    ahead = {"robot": {"pushes": [push]}, "odometry": {"drift": drift}}
    steps = run(simulation(**ahead), 400, lambda i: Twist(0.1, 0.0) if i == 0 else None)
    pushed = [step.index for step in steps for event in step.events]
    assert [event.kind for step in steps for event in step.events] == [EventKind.PUSHED]
    assert steps[pushed[0] - 2].pose.x_m == pytest.approx(0.2, abs=2e-3)
    during, after = steps[pushed[0] - 1 : pushed[0] + 49], steps[pushed[0] + 49]
    assert {step.twist for step in during} == {Twist(0.1 - 0.2, math.radians(60.0))}
    assert after.twist == Twist(0.1, 0.0)
    assert after.pose.yaw_rad == pytest.approx(math.radians(30.0))
    samples = [step for step in steps if step.odometry is not None]
    for step in samples:
        belief = step.odometry and step.odometry.pose
        assert belief is not None
        assert belief.x_m == pytest.approx(step.pose.x_m, abs=0.01)
        assert belief.yaw_rad == pytest.approx(step.pose.yaw_rad, abs=0.05)
