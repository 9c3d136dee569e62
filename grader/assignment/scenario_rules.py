"""What must fit together in one scenario: its launches and topics, its simulator or its bag."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

from grader.assignment.interfaces import FOLDERS
from grader.assignment.model import Assignment, Launch, Package, Scenario
from grader.spec.document import Place
from grader.spec.name import FIND_SHARE
from grader.spec.nearest_name import did_you_mean, nearest_or_all
from grader.spec.source import Source
from grader.spec.unit import format_duration
from grader.submission.read.rosdistro import PACKAGES
from sim.description import SimulatorOptions

Mistakes = Iterator[tuple[Place, str]]
"""Places below an entry of the YAML, each with what is wrong there."""

_STARTED_FIRST = "what is yours is started before the student's programs: leave 'after' out"
_KEYS_OF_RUNS = (
    *("repeat", "launch", "companions", "simulator", "stimuli", "world", "robots", "random"),
    *("until", "discovery", "shutdown", "limits"),
    *sorted({*SimulatorOptions.model_fields} - {"robot", "odometry", "topics"}),
)
"""Keys of a scenario that say how it is run; a bag is not run."""


@dataclass(frozen=True)
class KnownPackages:
    """The packages that a scenario may name.

    Attributes:
        handed_in: By students.
        authors: Beside assignment.yaml, by the names of their folders.
        underlays: As the assignment names them.
    """

    handed_in: dict[str, Package]
    authors: Collection[str]
    underlays: Sequence[str]

    @classmethod
    def of(cls, source: Source, assignment: Assignment) -> KnownPackages:
        """Look beside the YAML."""
        folders = [source.file.parent / name for name in FOLDERS]
        authors = {file.parent.name for folder in folders for file in folder.rglob("package.xml")}
        # Of a name that stands twice the first counts.
        handed_in = {package.name: package for package in reversed(assignment.packages)}
        return cls(handed_in, authors, assignment.underlays)

    @property
    def installed(self) -> set[str]:
        """Those whose files are installed when a scenario is run."""
        return {*self.handed_in, *self.authors, *PACKAGES}

    @property
    def are_all_known(self) -> bool:
        """Whether there are no others; what an underlay of the author's has is known when built."""
        return PACKAGES.issuperset(self.underlays)


def scenario_mistakes(scenario: Scenario, packages: KnownPackages) -> Mistakes:
    """Find everything in a scenario that does not fit together."""
    if scenario.bag is not None:
        yield from _bag(scenario)
    elif not scenario.launch:
        yield (), "the key 'launch' is missing; or 'bag', to judge a recording that is handed in"
    yield from _launches(scenario, packages)
    yield from _arguments(scenario, packages)
    yield from _recorded(scenario)
    yield from _until(scenario)
    yield from _robot(scenario)
    yield from _companions(scenario, packages)
    yield from _simulator(scenario, packages)
    for name in sorted(scenario.random.keys() & scenario.values.keys()):
        yield ("values", name), f"{name!r} is a random value too: leave one of them out"


def _bag(scenario: Scenario) -> Mistakes:
    assert scenario.bag is not None
    for key in _KEYS_OF_RUNS:
        if key in scenario.model_fields_set:
            yield (key,), f"a bag is read, and nothing is run: leave {key!r} out"
    for topic in {*scenario.bag.rename.values()} - scenario.recorded_types.keys():
        advice = nearest_or_all(topic, scenario.recorded_types)
        yield ("bag", "rename"), f"{topic!r} is not recorded.{advice}"


def _launches(scenario: Scenario, packages: KnownPackages) -> Mistakes:
    for index, launch in enumerate(scenario.launch):
        for place, text in _launch(launch, packages.handed_in):
            yield ("launch", index, *place), text
        if launch.after >= scenario.timeout:
            limit = format_duration(scenario.timeout)
            yield ("launch", index, "after"), f"the scenario ends after {limit} at the latest"
    if scenario.launch and all(launch.after > 0.0 for launch in scenario.launch):
        yield ("launch",), "nothing is started at once: one launch is without 'after'"


def _launch(launch: Launch, handed_in: dict[str, Package]) -> Mistakes:
    if launch.package is None and len(handed_in) != 1:
        names = ", ".join(reversed(handed_in))
        yield (), f"the key 'package' is missing: there is not exactly one package ({names})"
        return
    name = launch.package or next(iter(handed_in))
    if name not in handed_in:
        yield ("package",), no_package(name, handed_in)
    elif launch.executable is not None and launch.executable not in handed_in[name].executables:
        yield ("executable",), no_executable(launch.executable, handed_in[name])


def _arguments(scenario: Scenario, packages: KnownPackages) -> Mistakes:
    for place, name in _found_shares(scenario):
        if name not in packages.installed:
            text = f"there is no package {name!r}, not in packages/ either."
            yield place, text + did_you_mean(name, packages.installed)


def _found_shares(scenario: Scenario) -> Iterator[tuple[Place, str]]:
    """The packages whose folders arguments name, as in ``$(find-pkg-share course_files)``."""
    for number, launch in enumerate(scenario.launch):
        for index, argument in enumerate(launch.arguments):
            for name in FIND_SHARE.findall(argument):
                yield ("launch", number, "arguments", index), name


def _recorded(scenario: Scenario) -> Mistakes:
    topics = [recorded.topic for recorded in scenario.record]
    for index, topic in enumerate(topics):
        if topic in topics[:index]:
            yield ("record", index, "topic"), f"{topic!r} is recorded twice"


def _until(scenario: Scenario) -> Mistakes:
    until = scenario.until
    for key in ("messages", "quiet"):
        if not scenario.record and getattr(until, key) is not None:
            yield ("until", key), "no topic is recorded: 'record' is missing"
    if scenario.world is None and scenario.simulator is None and scenario.bag is None:
        for key in ("at_rest", "travelled"):
            if any(getattr(condition, key) is not None for condition in (until, *until.any)):
                yield ("until",), f"{key!r} is about the simulated robot: 'world' is missing"


def _robot(scenario: Scenario) -> Mistakes:
    """Keys about rosgrade's own simulated robot, where there is none or where there are several."""
    why_none = _why_no_robot(scenario)
    for key in ("robots", *SimulatorOptions.model_fields):
        if why_none is not None and key in scenario.model_fields_set:
            yield (key,), f"a simulated robot {why_none}"
    if scenario.world is not None and scenario.robots and "robot" in scenario.model_fields_set:
        yield ("robot",), "give either one 'robot' or several 'robots'"


def _why_no_robot(scenario: Scenario) -> str | None:
    """Why the keys of a simulated robot mean nothing in a scenario; None if they do."""
    if scenario.bag is not None:
        return None
    if scenario.simulator is not None:
        return "is not that of your 'simulator'"
    if scenario.turtles:
        return "is not in a world with turtles"
    return None if scenario.simulated_robots else "needs a 'world', which is missing"


def _companions(scenario: Scenario, packages: KnownPackages) -> Mistakes:
    for index, companion in enumerate(scenario.companions):
        name = companion.package
        if name not in packages.authors:
            text = f"there is no package {name!r} in packages/ beside assignment.yaml."
            advice = nearest_or_all(str(name), packages.authors)
            yield ("companions", index, "package"), text + advice
        elif companion.after:
            yield ("companions", index, "after"), _STARTED_FIRST


def _simulator(scenario: Scenario, packages: KnownPackages) -> Mistakes:
    """A simulator of the author's, and what does not go with it."""
    simulator = scenario.simulator
    if simulator is None:
        return
    if simulator.package in packages.handed_in:
        text = (
            f"{simulator.package!r} is what students hand in: the simulator is a program of yours"
        )
        yield ("simulator", "package"), text
    elif simulator.package not in packages.installed and packages.are_all_known:
        text = f"there is no package {simulator.package!r}, not in packages/ either."
        advice = did_you_mean(simulator.package, packages.installed)
        yield ("simulator", "package"), text + advice
    if simulator.after:
        yield ("simulator", "after"), _STARTED_FIRST
    for place, name in _found_shares(scenario):
        if name == simulator.package:
            yield place, "students do not see the simulator's files: put it into another package"
    if scenario.world is not None:
        text = (
            "a scenario is simulated once: give either a 'world' of rosgrade, or a 'simulator' of "
            "yours. What stands in its world can be given as its 'map'"
        )
        yield ("simulator",), text
    for number, stimulus in enumerate(scenario.stimuli):
        for index, answer in enumerate(getattr(stimulus, "answers", ())):
            if getattr(answer, "drive", None) is not None:
                text = "rosgrade drives no robot of a 'simulator' of yours: leave it out"
                yield ("stimuli", number, "answers", index, "drive"), text


def no_package(name: str, packages: Collection[str]) -> str:
    """The text for a name that no package of the assignment has."""
    return f"{name!r} is not among 'packages'.{nearest_or_all(name, packages, 'The packages are')}"


def no_executable(name: str, package: Package) -> str:
    """The text for a name that no executable of the package has."""
    advice = nearest_or_all(name, package.executables, "It has")
    return f"the package {package.name!r} has no executable {name!r} in 'packages'.{advice}"
