"""Verdicts do not depend on the seed: random values show the classic mistakes with each."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from grader.assignment.load import load_assignment
from grader.assignment.model import Scenario
from grader.assignment.random_values import draw_values, world_values
from grader.assignment.simulation import read_scenario_world
from grader.checks.messages.following import Follows
from sim.description import SimulatorOptions
from sim.simulation import STEP_S, make_simulation

SEEDS = range(200)
WRONG = 0.2
"""A mistake shows in this share of the messages or more."""

Row = npt.NDArray[np.float64]
_CUSTOM_INTERFACE = load_assignment("custom_interface")


def _odometry(scenario: Scenario, seed: int) -> Row:
    """Odometry of a run: rows of x, y, yaw, linear and angular velocity, z and w."""
    file = _CUSTOM_INTERFACE.folder / str(scenario.world)
    world = read_scenario_world(file, world_values(scenario, draw_values(scenario, seed)))
    assert scenario.odometry.continuous
    options = SimulatorOptions(
        robot=scenario.robot, lidar=scenario.lidar, odometry=scenario.odometry
    )
    simulation = make_simulation(world, options, seed)
    samples = []
    for _ in range(round((scenario.until.elapsed or 0.0) / STEP_S)):
        sample = simulation.advance().odometry
        if sample is not None:
            samples.append(sample)
    yaws = np.unwrap([one.pose.yaw_rad for one in samples])
    return np.array(
        [
            (
                one.pose.x_m,
                one.pose.y_m,
                one.pose.yaw_rad,
                one.twist.linear_m_s,
                one.twist.angular_rad_s,
                math.sin(yaw / 2),
                math.cos(yaw / 2),
            )
            for one, yaw in zip(samples, yaws, strict=True)
        ]
    ).T


def _right(x: Row, y: Row, yaw: Row, v: Row, w: Row, qz: Row, qw: Row) -> tuple[Row, ...]:
    return x, y, yaw, v, w


MISTAKES: dict[str, Callable[..., tuple[Row, ...]]] = {
    "x and y exchanged": lambda x, y, yaw, v, w, qz, qw: (y, x, yaw, v, w),
    "velocities exchanged": lambda x, y, yaw, v, w, qz, qw: (x, y, yaw, w, v),
    "no turn": lambda x, y, yaw, v, w, qz, qw: (x, y, yaw, v, 0 * w),
    "z for theta": lambda x, y, yaw, v, w, qz, qw: (x, y, qz, v, w),
    "2 asin(z)": lambda x, y, yaw, v, w, qz, qw: (x, y, 2 * np.arcsin(qz), v, w),
    "2 acos(w)": lambda x, y, yaw, v, w, qz, qw: (x, y, 2 * np.arccos(np.abs(qw)), v, w),
    "atan2(z, w)": lambda x, y, yaw, v, w, qz, qw: (x, y, np.arctan2(qz, qw), v, w),
    "atan of a quotient": lambda x, y, yaw, v, w, qz, qw: (
        x,
        y,
        np.arctan(2 * qw * qz / (1 - 2 * qz**2)),
        v,
        w,
    ),
    "degrees": lambda x, y, yaw, v, w, qz, qw: (x, y, np.degrees(yaw), v, w),
    "the other way round": lambda x, y, yaw, v, w, qz, qw: (x, y, -yaw, v, w),
    "from the start": lambda x, y, yaw, v, w, qz, qw: (x - x[0], y - y[0], yaw, v, w),
    "the first message": lambda *row: tuple(np.full_like(one, one[0]) for one in row[:5]),
    "speed without sign": lambda x, y, yaw, v, w, qz, qw: (x, y, yaw, np.abs(v), np.abs(w)),
}


def _wrong_share(
    odometry: Row, values: tuple[Row, ...], tolerance: float, within_s: float
) -> float:
    """Share of messages whose values are those of no odometry message within so long."""
    right, found = odometry[:5], np.array(values)
    period_s = 1.0 / 30.0
    fits = np.zeros(right.shape[1], dtype=bool)
    for back in range(int(within_s / period_s) + 1):
        earlier = np.roll(right, back, axis=1)
        earlier[:, :back] = np.nan
        standalone_build = np.abs(found - earlier)
        standalone_build[2] = np.abs(np.mod(found[2] - earlier[2] + math.pi, math.tau) - math.pi)
        fits |= np.all(standalone_build <= tolerance, axis=0)
    return 1.0 - float(fits.mean())


def test_every_start_of_custom_interface_shows_every_mistake() -> None:
    bound = next(one for one in _CUSTOM_INTERFACE.checks if one.spec.id == "follows")
    (scenario,) = _CUSTOM_INTERFACE.scenarios_of(bound)
    follows = bound.parameters
    assert isinstance(follows, Follows)
    for seed in SEEDS:
        odometry = _odometry(scenario, seed)
        assert _wrong_share(odometry, _right(*odometry), follows.tolerance, follows.within) == 0.0
        for name, mistake in MISTAKES.items():
            share = _wrong_share(odometry, mistake(*odometry), follows.tolerance, follows.within)
            assert share >= WRONG, f"{name} shows in {share:.0%} with seed {seed}"
