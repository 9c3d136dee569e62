"""Random values of a lesson show the classic mistakes with every seed.

Otherwise a wrong solution passes by luck now and then, and the grade hangs on the seed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from assignments.quaternion.checks.common_mistakes import MISTAKES
from assignments.quaternion.checks.conversion import (
    CONVERSIONS,
    Group,
    oracle,
    rotations_of_answers,
)
from grader.assignment.load import load_assignment
from grader.assignment.own_check import load_function
from grader.assignment.random_values import draw_values, world_values
from grader.assignment.simulation import read_scenario_world
from grader.findings.value import value_at
from grader.measure.printed import shows
from sim.lidar import Lidar

Rows = NDArray[np.float64]
SEEDS = range(200)
DECIMALS = 2
TURNS = math.radians(0.01)
QUATERNION = load_assignment("quaternion").folder
CONVERSION = {
    "axis_angle": "axis_angle_to_quaternion",
    "zero_axis": "axis_angle_to_quaternion",
    "rpy": "rpy_to_quaternion",
}
NOTHING = {"axis_angle_to_quaternion": (0, 0, 0, 1), "rpy_to_quaternion": (0, 0, 0, 1)}


@cache
def asked(function: str) -> tuple[str, Rows, list[Group]]:
    """Conversion, questions of all seeds one after the other, and the groups of each seed's."""
    conversion = CONVERSIONS[name := CONVERSION.get(function, "quaternion_to_rpy")]
    draw = load_function(f"cases.py:{function}", QUATERNION)
    rows = np.array(
        [[value_at(one, path) for path in conversion.asks] for seed in SEEDS for one in draw(seed)]
    )
    groups = [conversion.group(row) for row in rows[: len(rows) // len(SEEDS)].tolist()]
    return name, rows, groups


def wrong(function: str, formula: Callable[[Rows, str], Rows], tolerance: float) -> Rows:
    """Which answers are wrong by twice the tolerance, so that no rounding saves them.

    Returns:
        Shape (seeds, questions).
    """
    conversion, questions, groups = asked(function)
    with np.errstate(all="ignore"):
        answers = formula(questions, conversion)
        turns = rotations_of_answers(np.nan_to_num(answers))
        right = oracle(conversion, questions)
        chord = np.minimum(*(np.linalg.norm(right - sign * turns, axis=1) for sign in (1, -1)))
        found = ~np.isfinite(answers).all(axis=1) | (chord > tolerance)
        if answers.shape[1] == 4:
            found |= np.abs(np.linalg.norm(answers, axis=1) - 1.0) > 2e-6
    return found.reshape(len(SEEDS), len(groups))


def none_where(condition: Callable[[Rows], Rows]) -> Callable[[Rows, str], Rows]:
    """A node that takes some cases for no rotation."""

    def answers(questions: Rows, conversion: str) -> Rows:
        right = right_answers(conversion, questions)
        right[condition(questions)] = NOTHING.get(conversion, (0, 0, 0))
        return right

    return answers


def right_answers(conversion: str, questions: Rows) -> Rows:
    from scipy.spatial.transform import Rotation

    turns = oracle(conversion, questions)
    if conversion != "quaternion_to_rpy":
        return turns
    return Rotation.from_quat(turns).as_euler("xyz")


def previous(questions: Rows, conversion: str) -> Rows:
    """A node that is one message late."""
    right = right_answers(conversion, questions)
    return np.vstack([right[:1], right[:-1]])


def early_pole(margin: float) -> Callable[[Rows, str], Rows]:
    """A node that sees gimbal lock from a sine of the pitch on that is less than 1."""

    def answers(questions: Rows, conversion: str) -> Rows:
        right = right_answers(conversion, questions)
        x, y, z, w = (questions / np.linalg.norm(questions, axis=1, keepdims=True)).T
        sine = 2.0 * (w * y - z * x)
        locked = np.abs(sine) > margin
        there = np.column_stack([0.0 * sine, np.copysign(np.pi / 2, sine), 2 * np.arctan2(z, w)])
        right[locked] = there[locked]
        return right

    return answers


def length(questions: Rows) -> Rows:
    return np.linalg.norm(questions[:, :3], axis=1)


MISTAKES: dict[str, tuple[str, str, Callable[[Rows, str], Rows]]] = {
    "small angles dropped": ("axis_angle", "ordinary", none_where(lambda q: abs(q[:, 3]) < 1e-3)),
    "negative angles dropped": ("axis_angle", "ordinary", none_where(lambda q: q[:, 3] < 0.0)),
    "several turns dropped": ("axis_angle", "ordinary", none_where(lambda q: q[:, 3] > 2 * np.pi)),
    "short axes dropped": ("axis_angle", "scaled", none_where(lambda q: length(q) < 0.02)),
    "long axes dropped": ("axis_angle", "scaled", none_where(lambda q: length(q) > 50.0)),
    "axes by their sum": ("axis_angle", "scaled", none_where(lambda q: q[:, :3].sum(axis=1) == 0)),
    "small angles of rpy dropped": (
        "rpy",
        "ordinary",
        none_where(lambda q: (q < 1e-3).all(axis=1)),
    ),
    "half turns dropped": ("quaternion", "ordinary", none_where(lambda q: q[:, 3] == 0.0)),
    "one message late": ("quaternion", "ordinary", previous),
    "pole at 0.99": ("quaternion", "ordinary", early_pole(0.99)),
    "pole at 0.999": ("gimbal_lock", "ordinary", early_pole(0.999)),
    "pole at 0.9999": ("gimbal_lock", "ordinary", early_pole(0.9999)),
    "short quaternions dropped": (
        "scaled",
        "scaled",
        none_where(lambda q: np.linalg.norm(q, axis=1) < 0.15),
    ),
    "the answer before for a zero axis": ("zero_axis", "zero", previous),
    "the answer before for a quaternion of zeros": ("zero_quaternion", "zero", previous),
} | {
    f"{conversion}: {slip.words}": (
        "scaled" if "not scaled" in slip.words else function,
        "",
        lambda questions, _, slip=slip: slip.formula(questions),
    )
    for function, conversion in (
        ("axis_angle", "axis_angle_to_quaternion"),
        ("rpy", "rpy_to_quaternion"),
        ("quaternion", "quaternion_to_rpy"),
    )
    for slip in MISTAKES[conversion]
}


@pytest.mark.filterwarnings("ignore:Gimbal lock")
@pytest.mark.parametrize("mistake", MISTAKES)
def test_every_mistake_in_a_conversion_is_found_for_every_seed(mistake: str) -> None:
    function, group, formula = MISTAKES[mistake]
    found = wrong(function, formula, 10 * TURNS if function == "gimbal_lock" else TURNS)
    judged = [group in ("", one.value) for one in asked(function)[2]]
    assert found[:, judged].any(axis=1).all()


@pytest.mark.parametrize("function", ["zero_axis", "zero_quaternion"])
def test_the_answer_before_is_wrong_for_each_zero_but_the_first(function: str) -> None:
    found = wrong(function, previous, 0.1)
    zeros = [index for index, group in enumerate(asked(function)[2]) if group is Group.ZERO]
    assert zeros[0] == 0
    assert found[:, zeros[1:]].all()


def test_numbers_that_are_published_before_a_late_joiner_are_different_and_no_count() -> None:
    numbers = load_function("numbers.py:numbers", load_assignment("qos").folder)
    for seed in SEEDS:
        drawn = [item["data"] for item in numbers(seed)]
        assert len(set(drawn)) == len(drawn) == 14
        assert min(drawn) > 1000


def standing(scenario: str, seed: int) -> tuple[dict[str, str], float, float, float]:
    """What is drawn for the lesson on subscribers: where the robot stands, and what is ahead."""
    spec = next(one for one in SUBSCRIBERS.assignment.scenarios if one.id == scenario)
    values = draw_values(spec, seed)
    front = values["post_x"] - 0.01 - values["start_x"]
    return world_values(spec, values), values["start_x"], values["start_y"], front


SUBSCRIBERS = load_assignment("subscribers")
PLACES = [one.id for one in SUBSCRIBERS.assignment.scenarios]


@pytest.mark.parametrize("scenario", PLACES)
def test_one_decimal_never_shows_what_a_subscriber_must_log(scenario: str) -> None:
    for seed in SEEDS:
        for value in standing(scenario, seed)[1:]:
            for decimals in (0, 1):
                short = (round(value, decimals), math.trunc(value * 10**decimals) / 10**decimals)
                assert not any(shows(one, value, DECIMALS) for one in short), f"seed {seed}"


def test_what_was_read_off_at_one_place_is_wrong_at_another() -> None:
    assert len(PLACES) > 1
    for seed in SEEDS:
        for values in zip(*(standing(one, seed)[1:] for one in PLACES), strict=True):
            assert max(values) - min(values) > 0.05, f"seed {seed}"


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("scenario", PLACES)
def test_what_a_subscriber_must_log_is_no_other_number_of_the_robot(
    scenario: str, seed: int
) -> None:
    values, x, y, front = standing(scenario, seed)
    spec = next(one for one in SUBSCRIBERS.assignment.scenarios if one.id == scenario)
    world = read_scenario_world(SUBSCRIBERS.folder / str(spec.world), values)
    seen = Lidar(world, spec.lidar).scan(world.start, 0, np.random.default_rng(0)).ranges_m.tolist()
    assert seen[0] == pytest.approx(front, abs=1e-6)
    cone = [*seen[:11], *seen[-10:]]
    others = {
        "beside": seen[1], "last": seen[359], "behind": seen[180], "left": seen[90],
        "right": seen[270], "nearest": min(seen), "farthest": max(seen),
        "mean": sum(cone) / len(cone), "mean of three": (seen[0] + seen[1] + seen[359]) / 3,
        "mean of all": sum(seen) / 360, "wide cone": min(*seen[:31], *seen[-30:]),
        "count": 360.0, "limit": 3.5, "centimetres": 100.0 * front,
    }  # fmt: skip
    for name, value in others.items():
        assert not shows(value, front, DECIMALS), name
    # A cone that is not too wide has the post in it, and shows its distance.
    assert shows(min(cone), front, DECIMALS)
    for value in (0.0, 1.0, -x, -y, y, front):
        assert not shows(value, x, DECIMALS)
    assert not any(shows(value, y, DECIMALS) for value in (0.0, x, -x, -y))
