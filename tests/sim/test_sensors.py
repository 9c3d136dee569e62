"""IMU, wheel joints, battery, distance sensors: what they measure follows from the true motion."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from sim.description import SimulatorOptions
from sim.motion import NS, Twist
from sim.sensor_options import RangeOptions
from sim.sensors import GRAVITY_M_S2, Inertia, Joints
from sim.simulation import Simulation, make_simulation
from sim.world import parse_world

FRONT = {"topic": "/sonar", "frame": "sonar_link"}


def robot(world: str = "{}", seed: int = 1, **options: Any) -> Simulation:
    return make_simulation(parse_world(world), SimulatorOptions.model_validate(options), seed)


def readings(simulation: Simulation, command: Twist | None, seconds: float) -> list[Any]:
    found: list[Any] = []
    for _ in range(round(seconds * 100)):
        found += [reading for _, reading in simulation.advance(command).readings]
    return found


def test_an_imu_at_rest_feels_gravity_alone() -> None:
    found = readings(robot(imu={}), None, 1.0)
    assert len(found) == 50
    assert set(found) == {Inertia(0.0, 0.0, 0.0, 0.0, GRAVITY_M_S2)}


def test_the_acceleration_is_what_the_speed_gains() -> None:
    found = readings(robot(imu={"pose": [0, 0, "0 deg"]}), Twist(0.2, 0.0), 2.0)
    gained = sum(reading.ahead_m_s2 for reading in found) * 0.02
    assert gained == pytest.approx(0.2, abs=0.02)
    assert found[-1].ahead_m_s2 == 0.0


def test_in_a_curve_it_feels_the_centre_and_turns_as_the_robot_does() -> None:
    simulation = robot(imu={"pose": [-0.1, 0, "0 deg"]})
    last = readings(simulation, Twist(0.2, 0.5), 3.0)[-1]
    assert last.angular_rad_s == 0.5
    assert last.left_m_s2 == pytest.approx(0.2 * 0.5)
    assert last.ahead_m_s2 == pytest.approx(0.5 * 0.5 * 0.1)
    assert last.yaw_rad == pytest.approx(simulation.pose.yaw_rad)


def test_an_imu_that_is_mounted_sideways_feels_it_sideways() -> None:
    last = readings(robot(imu={"pose": [0, 0, "90 deg"]}), Twist(0.2, 0.5), 3.0)[-1]
    assert last.ahead_m_s2 == pytest.approx(0.1)
    assert last.left_m_s2 == pytest.approx(0.0)
    assert math.remainder(last.yaw_rad - 1.5 - math.pi / 2, math.tau) == pytest.approx(0, abs=0.1)


def test_the_wheels_turn_as_far_as_the_robot_drives() -> None:
    simulation = robot(joint_states={})
    last = readings(simulation, Twist(0.1, 0.0), 3.0)[-1]
    assert isinstance(last, Joints)
    assert last.angles_rad[0] == last.angles_rad[1] == pytest.approx(simulation.pose.x_m / 0.033)
    assert last.speeds_rad_s == pytest.approx((0.1 / 0.033,) * 2)


def test_on_the_spot_the_wheels_turn_against_each_other() -> None:
    left, right = readings(robot(joint_states={}), Twist(0.0, 1.0), 2.0)[-1].speeds_rad_s
    assert right == -left == pytest.approx(0.08 / 0.033)


def test_a_battery_empties_evenly_and_stays_empty() -> None:
    found = readings(robot(battery={"charge": "50 %", "lasts": "10 s"}), None, 8.0)
    assert found == pytest.approx([0.4, 0.3, 0.2, 0.1, 0.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize(("wall_x", "expected"), [(1.0, 1.0), (3.0, math.inf), (0.11, -math.inf)])
def test_a_distance_sensor_sees_the_nearest_thing_in_its_cone(
    wall_x: float, expected: float
) -> None:
    ranges = [{**FRONT, "fov": "30 deg", "range_min": 0.12, "range_max": 2}]
    world = f"segments: [[{wall_x}, -9, {wall_x}, 9]]"
    found = readings(robot(world, robot={"radius": 0.1}, ranges=ranges), None, 0.3)
    assert found == pytest.approx([expected] * 3)


def test_what_stands_beside_the_cone_is_not_seen() -> None:
    ranges = [{**FRONT, "fov": "20 deg"}, {**FRONT, "topic": "/left", "pose": [0, 0, "45 deg"]}]
    found = readings(robot("circles: [{centre: [1, 1], radius: 0.1}]", ranges=ranges), None, 0.1)
    assert found == [math.inf, pytest.approx(math.sqrt(2) - 0.1, abs=1e-3)]


def test_noise_comes_from_the_seed_and_changes_no_other_sensor() -> None:
    noisy = {"imu": {"noise": {"angular": "1 deg/s", "linear": "0.1 m/s^2"}}}
    one, same, other = (readings(robot(seed=seed, **noisy), None, 0.2) for seed in (1, 1, 2))
    assert one == same != other
    lidar = {"lidar": {"noise": "1 cm"}}
    world = "boxes: [{centre: [1, 0], size: [0.1, 9]}]"
    alone, beside = (robot(world, **lidar, **more) for more in ({}, noisy))
    for _ in range(20):
        a, b = alone.advance().scan, beside.advance().scan
    assert a is not None and b is not None
    assert np.array_equal(a.ranges_m, b.ranges_m)


def test_a_sensor_begins_and_ends_when_the_yaml_says() -> None:
    simulation = robot(battery={"rate": "10 Hz", "starts": "1 s", "stops": "2 s"})
    times = [
        step.time_ns / NS for step in (simulation.advance() for _ in range(300)) if step.readings
    ]
    assert (times[0], times[-1], len(times)) == (1.0, 1.9, 10)


def test_frames_are_fixed_to_the_robot_and_its_base_is_none_of_them() -> None:
    options = SimulatorOptions.model_validate(
        {"imu": {}, "joint_states": {}, "battery": {}, "ranges": [FRONT]}
    )
    assert {("base_link", "imu_link"), ("base_link", "sonar_link")} <= options.transforms
    assert ("base_link", "base_link") not in options.transforms
    of_robot = options.each({"tb1": options.robot})["tb1"]
    assert [one.topic for one in of_robot.sensors] == [
        *("/tb1/imu", "/tb1/joint_states", "/tb1/battery_state", "/tb1/sonar")
    ]
    assert ("tb1/base_link", "tb1/imu_link") in of_robot.transforms


@pytest.mark.parametrize(
    "wrong", [{"fov": "200 deg"}, {"fov": "0 deg"}, {"range_min": 5}, {"rate": "200 Hz"}]
)
def test_a_distance_sensor_that_cannot_be_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        RangeOptions.model_validate({**FRONT, **wrong})
