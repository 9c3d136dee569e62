"""Validation of scenarios as they are run: worlds, random values, stimuli."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from grader.assignment.interfaces import Interfaces
from grader.assignment.model import Assignment, Scenario
from grader.assignment.random_values import draw_values, fill_in, world_values
from grader.assignment.stimuli.stimulus_model import Preparation
from grader.errors import AssignmentError, Problem, UsageError
from grader.spec.document import Place
from grader.spec.source import Source, read_source
from grader.spec.unit import format_duration
from sim.robot import starting
from sim.world import World, turtle_names, world_of

_TRIED_SEEDS = range(20)
"""Enough that a robot which starts in a wall for some random values is found for nearly all."""


def read_scenario_world(file: Path, values: dict[str, str]) -> World:
    """Read a world; a scenario may have random values that its world does not use."""
    return _scenario_world(read_source(file), values)


def with_turtles(assignment: Assignment, folder: Path) -> Assignment:
    """The same assignment, whose scenarios know the turtles in their worlds."""
    scenarios = []
    for scenario in assignment.scenarios:
        names: tuple[str, ...] = ()
        if scenario.world is not None:
            # A world that cannot be read is told later.
            with suppress(AssignmentError, UsageError):
                names = turtle_names(read_source(folder / scenario.world))
        scenarios.append(scenario.with_turtles(names) if names else scenario)
    return assignment.model_copy(update={"scenarios": tuple(scenarios)})


def _scenario_world(world: Source, values: dict[str, str]) -> World:
    used = world.data.get("values", {})
    return world_of(world, {name: value for name, value in values.items() if name in used})


def problems(source: Source, assignment: Assignment, known: Interfaces) -> Iterator[Problem]:
    """Find worlds, random values and stimuli that do not fit.

    Worlds are tried with the values of several seeds, functions with the seed 0. Fields of
    messages are checked where the definitions are at hand.
    """
    default = next((one.name for one in assignment.packages), "")
    for index, scenario in enumerate(assignment.scenarios):
        place: Place = ("scenarios", index)
        values = draw_values(scenario, 0)
        launched = [f"{one.package or default}/{one.program}" for one in scenario.launch]
        preparation = Preparation(source.file.parent, known.find, 0, values, launched)
        yield from _parameters(source, place, scenario, values)
        if scenario.world is not None:
            yield from _world(source, (*place, "world"), scenario.world, scenario)
        if scenario.simulator is not None and scenario.simulator.map is not None:
            inside = (*place, "simulator", "map")
            yield from _world(source, inside, scenario.simulator.map, scenario)
        for inside, text in _stimuli(scenario, preparation):
            yield source.problem((*place, *inside), text)


def _stimuli(scenario: Scenario, preparation: Preparation) -> Iterator[tuple[Place, str]]:
    for number, item in enumerate(scenario.stimuli):
        for inside, text in item.mistakes(preparation, scenario):
            yield ("stimuli", number, *inside), text
        after = getattr(item, "after", None)
        if after is not None and after >= scenario.timeout:
            shown, timeout = format_duration(after), format_duration(scenario.timeout)
            text = f"{shown} is too late: the timeout of {timeout} ends the scenario before"
            yield ("stimuli", number, "after"), text
    if scenario.until.stimuli is not None and not any(one.has_end for one in scenario.stimuli):
        yield ("until", "stimuli"), "no stimulus of the scenario has an end"


def _parameters(
    source: Source, place: Place, scenario: Scenario, values: dict[str, float]
) -> Iterator[Problem]:
    for number, launch in enumerate(scenario.launch):
        for name, value in launch.parameters.items():
            try:
                fill_in(value, values)
            except UsageError as error:
                yield source.problem((*place, "launch", number, "parameters", name), str(error))


def _world(source: Source, place: Place, file: str, scenario: Scenario) -> Iterator[Problem]:
    values: dict[str, float] = {}
    try:
        world_source = read_source(source.file.parent / file)
        for seed in _TRIED_SEEDS if scenario.random else (0,):
            values = draw_values(scenario, seed)
            world = _scenario_world(world_source, world_values(scenario, values))
            if scenario.simulator is None:
                starting(world, scenario.simulated_robots)
    except (AssignmentError, UsageError) as error:
        drawn = ", ".join(f"{name} = {value:g}" for name, value in values.items())
        with_values = f" (with {drawn})" if drawn else ""
        yield source.problem(place, f"{error}{with_values}")
