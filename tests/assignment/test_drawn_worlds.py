"""Random values of the lessons with a robot: every seed distinguishes right from wrong."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np
import pytest

from grader.assignment.load import LoadedAssignment, load_assignment
from grader.assignment.model import Scenario
from grader.assignment.random_values import draw_values, fill_in, world_values
from grader.assignment.simulation import read_scenario_world
from grader.findings.finding import Status
from grader.recording.model import Recording
from sim.description import SimulatorOptions
from sim.motion import Pose, relative, wrap_angle
from sim.simulation import make_simulation
from sim.world import World
from tests.checks.builder import Controller, drive, judge, on_odometry
from tests.checks.test_motion_goal import Student

SEEDS = range(200)
BOT_CONTROLLER = load_assignment("bot_controller")
P_CONTROLLER = load_assignment("p_controller")


def worlds(
    loaded: LoadedAssignment, scenario_id: str, seeds: Iterable[int] = SEEDS
) -> Iterator[tuple[Scenario, World, dict[str, float]]]:
    """World and values of a scenario for each seed."""
    (scenario,) = [one for one in loaded.assignment.scenarios if one.id == scenario_id]
    for seed in seeds:
        values = draw_values(scenario, seed)
        file = loaded.folder / str(scenario.world)
        yield scenario, read_scenario_world(file, world_values(scenario, values)), values


def drawn(
    scenario_id: str, seeds: Iterable[int] = SEEDS
) -> Iterator[tuple[Scenario, Pose, Pose, dict[str, Any]]]:
    """Start, goal and parameters of a scenario of p_controller for each seed."""
    for scenario, world, values in worlds(P_CONTROLLER, scenario_id, seeds):
        given = {key: fill_in(it, values) for key, it in scenario.launch[0].parameters.items()}
        goal = Pose(given["goal_x"], given["goal_y"], wrap_angle(given["goal_theta"]))
        yield scenario, world.start, goal, given


def run(scenario: Scenario, start: Pose, controller: Controller) -> Recording:
    robot = scenario.robot.model_copy(update={"pose": start})
    return drive(controller, seconds=scenario.timeout, options={"robot": robot})


def reaches(recording: Recording, goal: Pose) -> Status:
    pose = [goal.x_m, goal.y_m, f"{goal.yaw_rad!r} rad"]
    return judge(
        "motion.reaches", recording, goal=pose, position="0.08 m", heading="0.1 rad"
    ).status


@pytest.mark.parametrize(
    ("scenario_id", "to_the_goal", "there"),
    [
        ("ahead", (21, 39), (49, 61)),
        ("behind", (153, 176), (-113, -95)),
        ("heading", (1, 9), (-36, -24)),
        ("backwards", (-25, -8), (71, 82)),
        ("random", (-58, -44), (25, 36)),
    ],
)
def test_every_start_asks_for_the_turns_that_tell_mistakes_apart(
    scenario_id: str, to_the_goal: tuple[float, float], there: tuple[float, float]
) -> None:
    """In degrees: from the start to the direction of the goal, and from that to its heading."""
    for _, start, goal, _ in drawn(scenario_id):
        direction = math.atan2(goal.y_m - start.y_m, goal.x_m - start.x_m)
        first = math.degrees(wrap_angle(direction - start.yaw_rad))
        second = math.degrees(wrap_angle(goal.yaw_rad - direction))
        assert to_the_goal[0] <= first <= to_the_goal[1], start
        assert there[0] <= second <= there[1], start


def test_no_start_is_where_the_handout_lets_it_start() -> None:
    """A way that leads to the goal from (0, 0) ends elsewhere, farther away than any tolerance."""
    for _, start, goal, given in drawn("ahead"):
        planned = relative(start, goal)
        off_m = math.hypot(planned.x_m - goal.x_m, planned.y_m - goal.y_m)
        assert off_m > 0.08 + given["goal_tolerance"], start


def test_every_push_ends_a_way_that_is_counted_and_none_that_is_seen() -> None:
    for scenario, start, goal, given in drawn("random", SEEDS[::8]):
        pose = goal.x_m, goal.y_m, goal.yaw_rad
        near = {"near": given["goal_tolerance"], "straight": given["angle_tolerance"]}
        sees = run(scenario, start, on_odometry(Student(pose, **near)))
        assert reaches(sees, goal) is Status.PASSED, start
        counts = run(scenario, start, _counting(Student(pose, top=0.12, **near)))
        assert reaches(counts, goal) is Status.FAILED, start


def _counting(student: Student) -> Controller:
    """A student that adds up its own speeds and takes only the heading from odometry."""
    place: list[float] = []

    def control(seen: Pose) -> tuple[float, float]:
        place[:] = place or [seen.x_m, seen.y_m]
        speed, turn = student(Pose(place[0], place[1], seen.yaw_rad))
        place[0] += speed / 30.0 * math.cos(seen.yaw_rad)
        place[1] += speed / 30.0 * math.sin(seen.yaw_rad)
        return speed, turn

    return on_odometry(control)


def front(ranges: list[float]) -> float:
    return ranges[0]


def least_of_a_cone(ranges: list[float]) -> float:
    return min(*ranges[:6], *ranges[-5:])


def mean_without_zeros(ranges: list[float]) -> float:
    beams = [one for one in (*ranges[:31], *ranges[-30:]) if one]
    return sum(beams) / len(beams) if beams else 0.0


def mean_of_what_was_measured(ranges: list[float]) -> float:
    return mean_without_zeros([one if math.isfinite(one) else 0.0 for one in ranges])


@pytest.mark.parametrize(
    ("scenario_id", "blind"),
    [
        ("ahead", []),
        ("pole", [least_of_a_cone]),
        ("blocked", []),
        ("crossing", [mean_without_zeros, mean_of_what_was_measured]),
        ("noise", [mean_without_zeros]),
    ],
)
def test_every_obstacle_is_seen_by_the_front_beam_and_missed_by_what_is_wrong(
    scenario_id: str, blind: list[Callable[[list[float]], float]]
) -> None:
    """From 0.18 m before it, standing: what is compared with 0.2 m there, in every drawn world."""
    for scenario, world, _ in worlds(BOT_CONTROLLER, scenario_id):
        options = SimulatorOptions(lidar=scenario.lidar)
        simulation = make_simulation(world, options, seed=1)
        late_ns = 3_000_000_000
        ahead_m = simulation.lidar.cast(world.start, late_ns)[0]
        pose = Pose(max(0.0, ahead_m - 0.18), 0.0, 0.0)
        noise = np.random.default_rng(1)
        ranges = [float(one) for one in simulation.lidar.scan(pose, late_ns, noise).ranges_m]
        assert 0.0 < front(ranges) <= 0.2 + 4 * scenario.lidar.noise
        for law in blind:
            assert not 0.0 < law(ranges) <= 0.25, law
