"""What must fit in scenarios with a simulated robot: world files, random values, the start."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from grader.assignment.model import Assignment, Scenario
from grader.assignment.random_values import draw_values, fill_in, world_values
from grader.errors import AssignmentError, Problem, UsageError
from grader.spec.document import Place
from grader.spec.source import Source, read_source
from sim.world import World, read_world

_TRIED_SEEDS = range(20)


def read_scenario_world(file: Path, values: dict[str, str]) -> World:
    """Read a world; a scenario may have random values that its world does not use.

    Raises:
        UsageError: The file cannot be read.
        AssignmentError: It says something that it must not.
    """
    used = read_source(file).data.get("values", {})
    return read_world(file, {name: value for name, value in values.items() if name in used})


def problems(source: Source, assignment: Assignment) -> Iterator[Problem]:
    """Find what does not fit; worlds are tried with the values of several seeds."""
    told: set[str] = set()
    for index, scenario in enumerate(assignment.scenarios):
        place: Place = ("scenarios", index)
        yield from _parameters(source, place, scenario)
        if scenario.world is not None:
            yield from _world(source, place, scenario, told)


def _parameters(source: Source, place: Place, scenario: Scenario) -> Iterator[Problem]:
    values = draw_values(scenario, 0)
    for number, launch in enumerate(scenario.launch):
        for name, value in launch.parameters.items():
            try:
                fill_in(value, values)
            except UsageError as error:
                yield source.problem((*place, "launch", number, "parameters", name), str(error))


def _world(source: Source, place: Place, scenario: Scenario, told: set[str]) -> Iterator[Problem]:
    """Try the world of a scenario; a mistake that another scenario told is told once."""
    file = source.file.parent / str(scenario.world)
    for seed in _TRIED_SEEDS if scenario.random else (0,):
        values = draw_values(scenario, seed)
        try:
            world = read_scenario_world(file, world_values(scenario, values))
            start = scenario.robot.pose if scenario.robot.pose is not None else world.start
            world.check_start(start, _radius_m(scenario))
        except (AssignmentError, UsageError) as error:
            if str(error) in told:
                return
            told.add(str(error))
            drawn = ", ".join(f"{name} = {value:g}" for name, value in values.items())
            yield source.problem((*place, "world"), f"{error}{f' (with {drawn})' if drawn else ''}")
            return


def _radius_m(scenario: Scenario) -> float:
    from sim.robot import MODELS

    if scenario.robot.radius is not None:
        return scenario.robot.radius
    return MODELS[scenario.robot.model].radius_m
