"""What must fit together in an assignment, beyond the form of each value; pure but for ruff.

That is what the YAML names elsewhere in itself, and what checks declare to need: a check without it
would end as an error, or as a failure, for every student.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import singledispatch
from graphlib import CycleError, TopologicalSorter
from typing import Any

from grader.assignment.binding import BoundCheck
from grader.assignment.interfaces import FOLDERS
from grader.assignment.model import SHOWN_FROM, Assignment, CheckSpec, Launch, Package, Scenario
from grader.assignment.repeat import runs_of
from grader.assignment.stimuli.stimulus_model import StimulusModel
from grader.checks import need as needs
from grader.checks.check import Subject
from grader.errors import GraderFault, Problem
from grader.findings.reference import Goal
from grader.findings.value import same_value
from grader.spec.document import Place
from grader.spec.name import FIND_SHARE, package_name
from grader.spec.nearest_name import did_you_mean, nearest_or_all
from grader.spec.source import Source
from grader.spec.unit import format_duration
from grader.submission.read.lint import find_ruff, known_rules
from grader.submission.read.rosdistro import PACKAGES
from sim.description import SimulatorOptions
from sim.turtles.interfaces import commands as turtle_commands
from sim.turtles.interfaces import servers as turtle_servers

_STARTED_FIRST = "what is yours is started before the student's programs: leave 'after' out"
_Lack = tuple[Place, str]
"""A place below the entry of a check, and what is wrong there."""
_OF_RUNS = (
    *("repeat", "launch", "companions", "simulator", "stimuli", "world", "robots", "random"),
    *("until", "discovery", "shutdown", "limits"),
    *sorted({*SimulatorOptions.model_fields} - {"robot", "odometry", "topics"}),
)
"""Keys of a scenario that say how it is run."""


def problems(
    source: Source, assignment: Assignment, bound: Sequence[BoundCheck | None]
) -> Iterator[Problem]:
    """Find everything that does not fit together."""
    for name, *keys in (("name", "packages"), ("id", "scenarios"), ("id", "checks", "manual")):
        yield from source.duplicates(name, *keys)
    if not assignment.packages and not (
        assignment.scenarios and all(one.bag is not None for one in assignment.scenarios)
    ):
        yield source.problem((), "the key 'packages' is missing")
    for index, package in enumerate(assignment.packages):
        try:
            package_name(package.name)
        except ValueError as error:
            yield source.problem(("packages", index, "name"), str(error))
    ids = [scenario.id for scenario in assignment.scenarios]
    beside = _packages_beside(source)
    shares = {*(package.name for package in assignment.packages), *beside, *PACKAGES}
    for index, scenario in enumerate(assignment.scenarios):
        for run in sorted({*runs_of(scenario)} & {*ids} - {scenario.id}):
            text = f"a run of {scenario.id!r} would be called as the scenario {run!r}"
            yield source.problem(("scenarios", index, "repeat"), text)
        own = (*_no_companion(scenario, beside), *_no_simulator(assignment, scenario, shares))
        for place, text in (*_scenario(assignment, scenario), *_no_share(scenario, shares), *own):
            yield source.problem(("scenarios", index, *place), text)
    yield from _requirements(source, assignment.checks)
    yield from _points(source, assignment)
    for index, check in enumerate(bound):
        for place, text in _check(assignment, check) if check is not None else ():
            yield source.problem(("checks", index, *place), text)


def _scenario(assignment: Assignment, scenario: Scenario) -> Iterator[tuple[Place, str]]:
    if scenario.bag is not None:
        for key in (key for key in _OF_RUNS if key in scenario.model_fields_set):
            yield (key,), f"a bag is read, and nothing is run: leave {key!r} out"
        for topic in {*scenario.bag.rename.values()} - scenario.recorded_types.keys():
            text = f"{topic!r} is not recorded."
            yield ("bag", "rename"), text + nearest_or_all(topic, scenario.recorded_types)
    elif not scenario.launch:
        yield (), "the key 'launch' is missing; or 'bag', to judge a recording that is handed in"
    for number, launch in enumerate(scenario.launch):
        for place, text in _launch(assignment, launch):
            yield ("launch", number, *place), text
        if launch.after >= scenario.timeout:
            limit = format_duration(scenario.timeout)
            yield ("launch", number, "after"), f"the scenario ends after {limit} at the latest"
    if scenario.launch and all(launch.after > 0.0 for launch in scenario.launch):
        yield ("launch",), "nothing is started at once: one launch is without 'after'"
    topics = [recorded.topic for recorded in scenario.record]
    for number, topic in enumerate(topics):
        if topic in topics[:number]:
            yield ("record", number, "topic"), f"{topic!r} is recorded twice"
    for name in sorted(scenario.random.keys() & scenario.values.keys()):
        yield ("values", name), f"{name!r} is a random value too: leave one of them out"
    until = scenario.until
    for key in ("messages", "quiet"):
        if not topics and getattr(until, key) is not None:
            yield ("until", key), "no topic is recorded: 'record' is missing"
    own = scenario.simulator
    if scenario.bag is None and (own is not None or not scenario.simulated_robots):
        lacks = "needs a 'world', which is missing"
        lacks = "is not in a world with turtles" if scenario.turtles else lacks
        lacks = "is not that of your 'simulator'" if own is not None else lacks
        for key in ("robots", *SimulatorOptions.model_fields):
            if key in scenario.model_fields_set:
                yield (key,), f"a simulated robot {lacks}"
    if scenario.world is None and scenario.simulator is None and scenario.bag is None:
        for key in ("at_rest", "travelled"):
            if any(getattr(one, key) is not None for one in (until, *until.any)):
                text = f"{key!r} is about the simulated robot: 'world' is missing"
                yield ("until",), text
    if scenario.world is not None and scenario.robots and "robot" in scenario.model_fields_set:
        yield ("robot",), "give either one 'robot' or several 'robots'"


def _launch(assignment: Assignment, launch: Launch) -> Iterator[tuple[Place, str]]:
    # Of a name that stands twice the first counts.
    packages = {package.name: package for package in reversed(assignment.packages)}
    if launch.package is None and len(packages) != 1:
        listed = ", ".join(one.name for one in assignment.packages)
        yield (), f"the key 'package' is missing: there is not exactly one package ({listed})"
        return
    package = packages.get(launch.package or assignment.packages[0].name)
    if package is None:
        yield ("package",), no_package(str(launch.package), packages)
    elif launch.executable is not None and launch.executable not in package.executables:
        yield ("executable",), no_executable(launch.executable, package)


def _packages_beside(source: Source) -> set[str]:
    """The author's packages, by the names of their folders."""
    folders = (source.file.parent / name for name in FOLDERS)
    return {file.parent.name for folder in folders for file in folder.rglob("package.xml")}


def _no_companion(scenario: Scenario, beside: Collection[str]) -> Iterator[tuple[Place, str]]:
    for number, one in enumerate(scenario.companions):
        if one.package not in beside:
            text = f"there is no package {one.package!r} in packages/ beside assignment.yaml."
            yield ("companions", number, "package"), text + nearest_or_all(str(one.package), beside)
        elif one.after:
            yield ("companions", number, "after"), _STARTED_FIRST


def _no_simulator(
    assignment: Assignment, scenario: Scenario, shares: Collection[str]
) -> Iterator[tuple[Place, str]]:
    own = scenario.simulator
    if own is None:
        return
    student = {package.name for package in assignment.packages}
    # What lies in an underlay of the author's is known when it is built.
    unknown = own.package not in shares and PACKAGES.issuperset(assignment.underlays)
    if own.package in student:
        text = f"{own.package!r} is what students hand in: the simulator is a program of yours"
        yield ("simulator", "package"), text
    elif unknown:
        text = f"there is no package {own.package!r}, not in packages/ either."
        yield ("simulator", "package"), text + did_you_mean(own.package, shares)
    if own.after:
        yield ("simulator", "after"), _STARTED_FIRST
    for number, launch in enumerate(scenario.launch):
        for index, argument in enumerate(launch.arguments):
            if own.package in FIND_SHARE.findall(argument):
                text = "students do not see the simulator's files: put it into another package"
                yield ("launch", number, "arguments", index), text
    if scenario.world is not None:
        text = (
            "a scenario is simulated once: give either a 'world' of rosgrade, or a 'simulator' of "
            "yours. What stands in its world can be given as its 'map'"
        )
        yield ("simulator",), text
    for number, item in enumerate(scenario.stimuli):
        for index, answer in enumerate(getattr(item, "answers", ())):
            if getattr(answer, "drive", None) is not None:
                text = "rosgrade drives no robot of a 'simulator' of yours: leave it out"
                yield ("stimuli", number, "answers", index, "drive"), text


def _no_share(scenario: Scenario, shares: Collection[str]) -> Iterator[tuple[Place, str]]:
    for number, launch in enumerate(scenario.launch):
        for index, argument in enumerate(launch.arguments):
            for name in FIND_SHARE.findall(argument):
                if name not in shares:
                    text = f"there is no package {name!r}, not in packages/ either."
                    place = ("launch", number, "arguments", index)
                    yield place, text + did_you_mean(name, shares)


def _requirements(source: Source, checks: Sequence[CheckSpec]) -> Iterator[Problem]:
    shown = {spec.id: spec.visibility for spec in checks}
    for index, spec in enumerate(checks):
        for number, required in enumerate(spec.requires):
            place: Place = ("checks", index, "requires", number)
            if required not in shown:
                advice = nearest_or_all(required, shown, "The checks are")
                yield source.problem(place, f"there is no check {required!r}.{advice}")
            # Else a student would see a skipped check without its reason.
            elif SHOWN_FROM.index(shown[required]) > SHOWN_FROM.index(spec.visibility):
                text = (
                    f"{required!r} is {shown[required].value!r}, so {spec.id!r} cannot be "
                    f"{spec.visibility.value!r}: a student would lose its points for a reason that "
                    "is not shown"
                )
                yield source.problem(place, text)
    try:
        TopologicalSorter({spec.id: spec.requires for spec in checks}).prepare()
    except CycleError as error:
        circle = error.args[1][::-1]
        place = ("checks", list(shown).index(circle[0]), "requires")
        text = f"never judged, because it requires itself: {' -> '.join(circle)}"
        yield source.problem(place, text)


def _points(source: Source, assignment: Assignment) -> Iterator[Problem]:
    found, stated = math.fsum(spec.points for spec in assignment.checks), assignment.points
    if found == 0.0:
        yield source.problem(("checks",), "the points of all checks add up to 0")
    if stated is not None and not math.isclose(found, stated):
        text = f"the points of all checks add up to {found:g}, not to {stated:g}"
        yield source.problem(("points",), text)


def _check(assignment: Assignment, bound: BoundCheck) -> Iterator[tuple[Place, str]]:
    name, spec = bound.check.name, bound.spec
    scenarios = {scenario.id: scenario for scenario in assignment.scenarios}
    judged = assignment.judged_by(spec)
    if bound.check.subject is Subject.SUBMISSION:
        if spec.scenarios or spec.window is not None:
            key = "scenarios" if spec.scenarios else "from, to, after, before and while"
            text = f"{name!r} judges what was handed in, not a run: leave {key!r} out"
            yield ("scenarios",), text
    elif not scenarios:
        yield (), f"{name!r} judges a run, but the assignment has no scenarios"
    else:
        for number, scenario in enumerate(spec.scenarios):
            if scenario not in scenarios:
                advice = nearest_or_all(scenario, scenarios, "The scenarios are")
                yield ("scenarios", number), f"there is no scenario {scenario!r}.{advice}"
        if not spec.scenarios:
            yield from _other_programs(judged)
    yield from _robots(bound, judged)
    yield from _of_run(assignment, bound, judged)
    yield from _unknown_values(bound, judged)
    for one in judged:
        if spec.from_ >= one.timeout:
            text = (
                f"the scenario {one.id!r} ends after {format_duration(one.timeout)} at the latest"
            )
            yield ("from",), text


def _robots(bound: BoundCheck, judged: Sequence[Scenario]) -> Iterator[tuple[Place, str]]:
    """A robot that a scenario does not have, or none where it has several."""
    for one in judged:
        if bound.spec.robot is not None and bound.spec.robot not in one.robots:
            advice = nearest_or_all(bound.spec.robot, one.robots, "Its 'robots' are")
            yield ("robot",), f"the scenario {one.id!r} has no robot {bound.spec.robot!r}.{advice}"


def _of_run(
    assignment: Assignment, bound: BoundCheck, judged: Sequence[Scenario]
) -> Iterator[tuple[Place, str]]:
    """What a check, and what its windows look at, need and lack."""
    is_of_run = bound.check.subject is Subject.RECORDING
    bag = next((one for one in judged if one.bag is not None and is_of_run), None)
    if bag is not None and not bound.parameters.judges_bags:
        text = (
            f"{bound.check.name!r} looks at more than a bag holds, and the scenario {bag.id!r} is "
            "a bag: messages with their times, their publishers, and the motion of the robot by "
            "its odometry"
        )
        yield ("uses",), text
    else:
        yield from need_problems(assignment, bound, judged)
    for key, phase in bound.spec.window.phases.items() if bound.spec.window else ():
        if bag is not None and not phase.judges_bags:
            yield (key,), f"the scenario {bag.id!r} is a bag, which does not show this"
            continue
        for place, text in need_problems(assignment, replace(bound, parameters=phase), judged):
            yield (key, *place[1:]), text


def _unknown_values(bound: BoundCheck, judged: Sequence[Scenario]) -> Iterator[tuple[Place, str]]:
    """Names in parameters for which a scenario that the check judges has no value."""
    for key, goal in bound.parameters:
        for one in judged if isinstance(goal, Goal) else ():
            known = {**one.values, **one.random}
            for name in (name for name in goal.names if name not in known):
                advice = nearest_or_all(name, known, "It has")
                yield ("with", key), f"the scenario {one.id!r} has no value {name!r}.{advice}"


def _other_programs(scenarios: Sequence[Scenario]) -> Iterator[tuple[Place, str]]:
    """Checks without ``scenarios`` where the scenarios launch different programs."""
    launched = [sorted(map(_program, scenario.launch)) for scenario in scenarios]
    for scenario, programs in zip(scenarios, launched, strict=True):
        if programs != launched[0]:
            text = (
                "name the 'scenarios' that it judges: they launch different programs: "
                f"{scenarios[0].id!r} launches {', '.join(launched[0])}, but {scenario.id!r} "
                f"{', '.join(programs)}"
            )
            yield (), text
            return


def _program(launch: Launch) -> str:
    """A launched program with the rules that give its nodes and topics other names."""
    renamed = [*launch.remap.items(), ("__node", launch.name), ("__ns", launch.namespace)]
    rules = ", ".join(f"{old}:={new}" for old, new in renamed if new is not None)
    return f"'{launch.program}'" + (f" ({rules})" if rules else "")


@dataclass(frozen=True)
class _User:
    """A check with the assignment and the scenarios that must meet its needs."""

    bound: BoundCheck
    assignment: Assignment
    scenarios: Sequence[Scenario]

    def value(self, key: str | None) -> Any:
        return getattr(self.bound.parameters, key) if key else None


def need_problems(
    assignment: Assignment, bound: BoundCheck, scenarios: Sequence[Scenario]
) -> Iterator[_Lack]:
    """Find what a check needs and the assignment lacks."""
    user = _User(bound, assignment, scenarios)
    for need in bound.parameters.needs:
        yield from _lacks(need, user)


@singledispatch
def _lacks(need: needs.Need, user: _User) -> Iterator[_Lack]:
    raise NotImplementedError(type(need))


@_lacks.register
def _(need: needs.Bags, user: _User) -> Iterator[_Lack]:
    yield from ()


@_lacks.register
def _(need: needs.SimulatedRobot, user: _User) -> Iterator[_Lack]:
    for scenario in user.scenarios:
        if (need.about and user.value(need.about) is None) or user.value(need.unless) is not None:
            continue
        if scenario.robots and user.bound.spec.robot is None:
            names = ", ".join(scenario.robots)
            text = f"the scenario {scenario.id!r} has several robots: say which 'robot' it judges"
            yield (), f"{text} ({names})"
        if not scenario.has_robot:
            what = "turtles in its world" if scenario.turtles else "no 'world'"
            text = f"the scenario {scenario.id!r} has {what}, and so no simulated robot"
            if scenario.bag is not None:
                text = f"the odometry of the scenario {scenario.id!r} is not enabled"
            yield ("uses",), text


@_lacks.register
def _(need: needs.WithTurtles, user: _User) -> Iterator[_Lack]:
    for scenario in user.scenarios:
        if not scenario.turtles:
            text = f"the scenario {scenario.id!r} has no 'world' with turtles"
            yield ("uses",), text


_UNTOLD = {
    "contact": "does not say what its robot touches: give it the topic 'contact'",
    "map": "does not say what stands around its robot: give it a 'map'",
}


@_lacks.register
def _(need: needs.OfSimulator, user: _User) -> Iterator[_Lack]:
    if not need.applies_to(user.bound.parameters):
        return
    for scenario in user.scenarios:
        if scenario.simulator is not None and getattr(scenario.simulator, need.key) is None:
            text = f"the simulator of the scenario {scenario.id!r} {_UNTOLD[need.key]}"
            yield ("with", need.about) if need.about else ("uses",), text


@_lacks.register
def _(need: needs.Recorded, user: _User) -> Iterator[_Lack]:
    topic, interface = user.value(need.topic), user.value(need.type)
    if topic is None or user.value(need.kind) == "subscription":
        return
    topic += need.suffix
    for scenario in user.scenarios:
        recorded = scenario.recorded_types
        if need.or_sent:
            sent = (one.exchanged for one in _doing(needs.Act.PUBLISH, scenario))
            recorded.update(filter(None, sent))
        if topic not in recorded:
            text = f"the scenario {scenario.id!r} does not record {topic!r}."
            yield ("with", need.topic), text + nearest_or_all(topic, recorded, "It records")
        elif interface not in (None, recorded[topic]):
            text = f"the scenario {scenario.id!r} records {topic!r} as {recorded[topic]!r}"
            yield ("with", "type"), text


@_lacks.register
def _(need: needs.SentOrOwn, user: _User) -> Iterator[_Lack]:
    topic, own = user.value(need.topic), user.value(need.own)
    for scenario in user.scenarios:
        given = {one.subject for one in _doing(needs.Act.PUBLISH, scenario)}
        commands = {one.topics.command.topic for one in scenario.simulated_robots.values()}
        commands |= {*turtle_commands(scenario.turtles)}
        given |= {*scenario.model_copy(update={"record": ()}).recorded_types} - commands
        recorded = {*scenario.recorded_types} - given
        if own and topic not in recorded:
            text = f"the scenario {scenario.id!r} records no {topic!r} of the student."
            yield ("with", need.topic), text + nearest_or_all(topic, recorded, "It records")
        elif not own and topic not in given:
            text = (
                f"nothing sends {topic!r} in the scenario {scenario.id!r}: no robot, no stimulus. "
                "If a node of the student publishes it, write 'own: true'"
            )
            yield ("with", need.topic), text


@_lacks.register
def _(need: needs.OwnTransform, user: _User) -> Iterator[_Lack]:
    edge = user.value(need.parent), user.value(need.child)
    for scenario in user.scenarios:
        if any(edge in one.frames for one in scenario.stimuli):
            text = f"a stimulus of the scenario {scenario.id!r} publishes this transform itself"
            yield ("with", need.child), text
        if any(edge in robot.transforms for robot in scenario.simulated_robots.values()):
            text = (
                f"the robot of the scenario {scenario.id!r} publishes this transform itself: write "
                "'topics: {tf: {enabled: false}}' there"
            )
            yield ("with", need.child), text


@_lacks.register
def _(need: needs.Stimulated, user: _User) -> Iterator[_Lack]:
    if user.value(need.parameter) is None:
        return
    wanted, key = user.value(need.parameter) + need.suffix, ("with", need.parameter)
    having, fields = str(need.having).partition(":")[0], user.value(need.fields) or {}
    for scenario in user.scenarios:
        able = _doing(need.act, scenario)
        mine = [one for one in able if one.subject == wanted]
        does = f"no stimulus of the scenario {scenario.id!r} {need.act.value} {wanted!r}"
        served = turtle_servers(scenario.turtles) if scenario.turtles else {}
        if need.act is needs.Act.SERVE and wanted in served:
            continue
        if not mine:
            yield key, f"{does}." + nearest_or_all(wanted, [one.subject for one in able])
        elif need.having and not any(one.differs_in(having) for one in mine):
            yield key, f"{does} with {having!r}: add '{need.having}'"
        yield from _impatient(
            user, scenario, need.within, [one for one in mine if one.sends(fields)]
        )


@_lacks.register
def _(need: needs.ParameterSet, user: _User) -> Iterator[_Lack]:
    yield from _lacks(needs.Stimulated(needs.Act.SET_PARAMETERS, need.node), user)
    node, name, wanted = map(user.value, (need.node, need.name, need.value))
    for scenario in user.scenarios:
        mine = [one for one in _doing(needs.Act.SET_PARAMETERS, scenario) if one.subject == node]
        tried = [given[name] for one in mine for given in one.sent_fields if name in given]
        drawn = any(isinstance(value, str) for value in tried)
        if mine and not drawn and not any(same_value(wanted, value) for value in tried):
            listed = ", ".join(map(repr, tried)) or "nothing"
            text = f"the scenario {scenario.id!r} sets {name!r} to {listed}, never to {wanted!r}"
            yield ("with", need.value), text


@_lacks.register
def _(need: needs.ParametersGiven, user: _User) -> Iterator[_Lack]:
    for scenario in user.scenarios:
        given = {name for launch in scenario.launch for name in launch.parameters}
        # A launch file may give more, by a parameter file.
        if not given and not any(launch.file for launch in scenario.launch):
            yield ("with",), f"the scenario {scenario.id!r} launches nothing with 'parameters'"
        for index, name in enumerate(user.value(need.names)):
            if given and name not in given:
                text = f"the scenario {scenario.id!r} gives no parameter {name!r}."
                yield ("with", need.names, index), text + nearest_or_all(name, sorted(given))


def _doing(act: needs.Act, scenario: Scenario) -> list[StimulusModel]:
    return [one for one in scenario.stimuli if act in one.provides]


@_lacks.register
def _(need: needs.Submitted, user: _User) -> Iterator[_Lack]:
    name, executable = user.value(need.package), user.value(need.executable)
    packages = {package.name: package for package in user.assignment.packages}
    if name not in packages:
        yield ("with", need.package), no_package(name, packages)
    elif need.executable and executable not in (None, *packages[name].executables):
        yield ("with", need.executable), no_executable(executable, packages[name])


@_lacks.register
def _(need: needs.RuffRules, user: _User) -> Iterator[_Lack]:
    ruff = find_ruff()
    try:
        known = known_rules(ruff) if ruff is not None else frozenset()
    except GraderFault:
        return
    for index, rule in enumerate(user.value(need.rules) if known else ()):
        if not any(code.startswith(rule) for code in known):
            text = f"ruff has no rule {rule!r}." + did_you_mean(rule, known)
            yield ("with", need.rules, index), text


def _impatient(
    user: _User, scenario: Scenario, key: str | None, asking: Iterable[StimulusModel]
) -> Iterator[_Lack]:
    """The problem of a stimulus that waits for less time than the check allows."""
    if key is None:
        return
    within_s = user.value(key)
    short_s = min((one.patience_s for one in asking), default=within_s)
    if short_s < within_s:
        short, needed = format_duration(short_s), format_duration(within_s)
        text = f"a stimulus of the scenario {scenario.id!r} waits only {short} for an answer"
        yield ("with", key), f"{text}: give it 'within: {needed}' too"


def no_package(name: str, names: Collection[str]) -> str:
    """The text for a name that no package of the assignment has."""
    return f"{name!r} is not among 'packages'.{nearest_or_all(name, names, 'The packages are')}"


def no_executable(name: str, package: Package) -> str:
    """The text for a name that no executable of the package has."""
    advice = nearest_or_all(name, package.executables, "It has")
    return f"the package {package.name!r} has no executable {name!r} in 'packages'.{advice}"
