"""What checks need of the scenarios that they judge, and what is missing there.

A check *declares* its needs (:mod:`grader.checks.need`); here is a function for each kind of them.
A check without what it needs would end as an error, or as a failure, for every student.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import singledispatch
from typing import Any

from grader.assignment.binding import BoundCheck
from grader.assignment.model import Assignment, Scenario
from grader.assignment.scenario_rules import Mistakes, no_executable, no_package
from grader.assignment.stimuli.stimulus_model import StimulusModel
from grader.checks import need as needs
from grader.errors import GraderFault
from grader.findings.expected import same_value
from grader.spec.nearest_name import did_you_mean, nearest_or_all
from grader.spec.unit import format_duration
from grader.submission.read.lint import find_ruff, known_rules
from sim.turtles.interfaces import commands as turtle_commands
from sim.turtles.interfaces import servers as turtle_servers


@dataclass(frozen=True)
class _Demand:
    """A check with the assignment and the scenarios that must meet its needs."""

    bound: BoundCheck
    assignment: Assignment
    scenarios: Sequence[Scenario]

    def value(self, parameter: str | None) -> Any:
        """The value of a parameter of the check; None where the need names no parameter."""
        return getattr(self.bound.parameters, parameter) if parameter else None


def unmet_needs(
    assignment: Assignment, bound: BoundCheck, scenarios: Sequence[Scenario]
) -> Mistakes:
    """Find what a check needs and the assignment lacks."""
    demand = _Demand(bound, assignment, scenarios)
    for need in bound.parameters.needs:
        yield from _unmet(need, demand)


@singledispatch
def _unmet(need: needs.Need, demand: _Demand) -> Mistakes:
    raise NotImplementedError(type(need))


@_unmet.register
def _bags(need: needs.Bags, demand: _Demand) -> Mistakes:
    # Whether there are bags is known when something is handed in.
    yield from ()


@_unmet.register
def _simulated_robot(need: needs.SimulatedRobot, demand: _Demand) -> Mistakes:
    is_about_robot = need.about is None or demand.value(need.about) is not None
    if not is_about_robot or demand.value(need.unless) is not None:
        return
    for scenario in demand.scenarios:
        if scenario.robots and demand.bound.spec.robot is None:
            names = ", ".join(scenario.robots)
            text = f"the scenario {scenario.id!r} has several robots: say which 'robot' it judges"
            yield (), f"{text} ({names})"
        if scenario.has_robot:
            continue
        if scenario.bag is not None:
            text = f"the odometry of the scenario {scenario.id!r} is not enabled"
        else:
            what = "turtles in its world" if scenario.turtles else "no 'world'"
            text = f"the scenario {scenario.id!r} has {what}, and so no simulated robot"
        yield ("uses",), text


@_unmet.register
def _turtles(need: needs.WithTurtles, demand: _Demand) -> Mistakes:
    for scenario in demand.scenarios:
        if not scenario.turtles:
            yield ("uses",), f"the scenario {scenario.id!r} has no 'world' with turtles"


_UNTOLD = {
    "contact": "does not say what its robot touches: give it the topic 'contact'",
    "map": "does not say what stands around its robot: give it a 'map'",
}


@_unmet.register
def _of_simulator(need: needs.OfSimulator, demand: _Demand) -> Mistakes:
    if not need.applies_to(demand.bound.parameters):
        return
    for scenario in demand.scenarios:
        if scenario.simulator is not None and getattr(scenario.simulator, need.key) is None:
            text = f"the simulator of the scenario {scenario.id!r} {_UNTOLD[need.key]}"
            yield ("with", need.about) if need.about else ("uses",), text


@_unmet.register
def _recorded(need: needs.Recorded, demand: _Demand) -> Mistakes:
    topic, interface = demand.value(need.topic), demand.value(need.type)
    if topic is None or demand.value(need.kind) == "subscription":
        return
    topic += need.suffix
    for scenario in demand.scenarios:
        types = scenario.recorded_types
        if need.or_sent:
            sent = (stimulus.exchanged for stimulus in _acting(needs.Act.PUBLISH, scenario))
            types.update(filter(None, sent))
        if topic not in types:
            text = f"the scenario {scenario.id!r} does not record {topic!r}."
            yield ("with", need.topic), text + nearest_or_all(topic, types, "It records")
        elif interface not in (None, types[topic]):
            text = f"the scenario {scenario.id!r} records {topic!r} as {types[topic]!r}"
            yield ("with", "type"), text


@_unmet.register
def _sent_or_own(need: needs.SentOrOwn, demand: _Demand) -> Mistakes:
    topic, is_own = demand.value(need.topic), demand.value(need.own)
    for scenario in demand.scenarios:
        sent_to_student = _sent_to_student(scenario)
        students = {*scenario.recorded_types} - sent_to_student
        if is_own and topic not in students:
            text = f"the scenario {scenario.id!r} records no {topic!r} of the student."
            yield ("with", need.topic), text + nearest_or_all(topic, students, "It records")
        elif not is_own and topic not in sent_to_student:
            text = (
                f"nothing sends {topic!r} in the scenario {scenario.id!r}: no robot, no stimulus. "
                "If a node of the student publishes it, write 'own: true'"
            )
            yield ("with", need.topic), text


def _sent_to_student(scenario: Scenario) -> set[str]:
    """The topics that a robot, turtles or a stimulus publish on."""
    stimulated = {stimulus.subject for stimulus in _acting(needs.Act.PUBLISH, scenario)}
    of_robots = {*scenario.model_copy(update={"record": ()}).recorded_types}
    # Their commands come from the student.
    commands = {robot.topics.command.topic for robot in scenario.simulated_robots.values()}
    return stimulated | (of_robots - commands - {*turtle_commands(scenario.turtles)})


@_unmet.register
def _own_transform(need: needs.OwnTransform, demand: _Demand) -> Mistakes:
    frames = demand.value(need.parent), demand.value(need.child)
    for scenario in demand.scenarios:
        if any(frames in stimulus.frames for stimulus in scenario.stimuli):
            text = f"a stimulus of the scenario {scenario.id!r} publishes this transform itself"
            yield ("with", need.child), text
        if any(frames in robot.transforms for robot in scenario.simulated_robots.values()):
            text = (
                f"the robot of the scenario {scenario.id!r} publishes this transform itself: write "
                "'topics: {tf: {enabled: false}}' there"
            )
            yield ("with", need.child), text


@_unmet.register
def _stimulated(need: needs.Stimulated, demand: _Demand) -> Mistakes:
    if demand.value(need.parameter) is None:
        return
    place = ("with", need.parameter)
    subject = demand.value(need.parameter) + need.suffix
    key_to_have = str(need.having).partition(":")[0]
    fields = demand.value(need.fields) or {}
    for scenario in demand.scenarios:
        served_by_turtles = turtle_servers(scenario.turtles) if scenario.turtles else {}
        if need.act is needs.Act.SERVE and subject in served_by_turtles:
            continue
        acting = _acting(need.act, scenario)
        on_subject = [stimulus for stimulus in acting if stimulus.subject == subject]
        none_does = f"no stimulus of the scenario {scenario.id!r} {need.act.value} {subject!r}"
        if not on_subject:
            advice = nearest_or_all(subject, [stimulus.subject for stimulus in acting])
            yield place, f"{none_does}.{advice}"
        elif need.having and not any(one.differs_in(key_to_have) for one in on_subject):
            yield place, f"{none_does} with {key_to_have!r}: add '{need.having}'"
        if need.within is not None:
            asking = [stimulus for stimulus in on_subject if stimulus.sends(fields)]
            yield from _impatient(scenario, need.within, demand.value(need.within), asking)


def _impatient(
    scenario: Scenario, key: str, within_s: float, asking: Iterable[StimulusModel]
) -> Mistakes:
    """A stimulus that waits for less time than the check allows."""
    patience_s = min((stimulus.patience_s for stimulus in asking), default=within_s)
    if patience_s < within_s:
        short, needed = format_duration(patience_s), format_duration(within_s)
        text = f"a stimulus of the scenario {scenario.id!r} waits only {short} for an answer"
        yield ("with", key), f"{text}: give it 'within: {needed}' too"


@_unmet.register
def _parameter_set(need: needs.ParameterSet, demand: _Demand) -> Mistakes:
    yield from _unmet(needs.Stimulated(needs.Act.SET_PARAMETERS, need.node), demand)
    node, name = demand.value(need.node), demand.value(need.name)
    expected = demand.value(need.value)
    for scenario in demand.scenarios:
        setting = _acting(needs.Act.SET_PARAMETERS, scenario)
        of_node = [stimulus for stimulus in setting if stimulus.subject == node]
        values = [fields[name] for one in of_node for fields in one.sent_fields if name in fields]
        # A text may be a value that is drawn in the run, such as "$speed".
        may_be_drawn = any(isinstance(value, str) for value in values)
        is_set = may_be_drawn or any(same_value(expected, value) for value in values)
        if of_node and not is_set:
            listed = ", ".join(map(repr, values)) or "nothing"
            text = f"the scenario {scenario.id!r} sets {name!r} to {listed}, never to {expected!r}"
            yield ("with", need.value), text


@_unmet.register
def _parameters_given(need: needs.ParametersGiven, demand: _Demand) -> Mistakes:
    for scenario in demand.scenarios:
        given = {name for launch in scenario.launch for name in launch.parameters}
        if given:
            for index, name in enumerate(demand.value(need.names)):
                if name not in given:
                    text = f"the scenario {scenario.id!r} gives no parameter {name!r}."
                    yield ("with", need.names, index), text + nearest_or_all(name, sorted(given))
        # A launch file may give some, by a parameter file.
        elif not any(launch.file for launch in scenario.launch):
            yield ("with",), f"the scenario {scenario.id!r} launches nothing with 'parameters'"


def _acting(act: needs.Act, scenario: Scenario) -> list[StimulusModel]:
    return [stimulus for stimulus in scenario.stimuli if act in stimulus.provides]


@_unmet.register
def _submitted(need: needs.Submitted, demand: _Demand) -> Mistakes:
    name, executable = demand.value(need.package), demand.value(need.executable)
    packages = {package.name: package for package in demand.assignment.packages}
    if name not in packages:
        yield ("with", need.package), no_package(name, packages)
    elif need.executable and executable not in (None, *packages[name].executables):
        yield ("with", need.executable), no_executable(executable, packages[name])


@_unmet.register
def _ruff_rules(need: needs.RuffRules, demand: _Demand) -> Mistakes:
    ruff = find_ruff()
    if ruff is None:
        return
    try:
        known = known_rules(ruff)
    except GraderFault:
        return
    if not known:
        return
    for index, rule in enumerate(demand.value(need.rules)):
        if not any(code.startswith(rule) for code in known):
            text = f"ruff has no rule {rule!r}.{did_you_mean(rule, known)}"
            yield ("with", need.rules, index), text
