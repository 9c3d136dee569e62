"""What is valid in an assignment but looks like a mistake, for ``rosgrade validate``. Pure."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

from grader.assignment.load import LoadedAssignment
from grader.assignment.model import Assignment, Visibility
from grader.assignment.mutant import Mutant
from grader.checks.check import Parameters
from grader.spec.nearest_name import did_you_mean
from grader.submission.read.dependencies import is_known, meant
from sim.turtles.interfaces import published


def lint_warnings(loaded: LoadedAssignment, mutants: Sequence[Mutant] | None) -> Iterator[str]:
    """Find what an author should look at once more."""
    yield from _unknown_topics(loaded)
    yield from _shown_runs(loaded)
    yield from _dependencies(loaded.assignment)
    if mutants is None:
        yield "there is no mutants.yaml: nothing shows that the checks notice mistakes"
        return
    lost = {name for mutant in mutants for name in mutant.loses}
    for bound in loaded.checks:
        if bound.spec.id not in lost:
            yield f"no mutant loses the check {bound.spec.id!r}: nothing shows that it can fail"


def _unknown_topics(loaded: LoadedAssignment) -> Iterator[str]:
    for bound in loaded.checks:
        for scenario in loaded.scenarios_of(bound):
            exchanged = {one.exchanged[0] for one in scenario.stimuli if one.exchanged}
            known = {*scenario.recorded_types, *scenario.camera_topics, *exchanged}
            known |= {*published(scenario.turtles)}
            for topic in _topics(bound.parameters, known):
                if topic not in known:
                    yield (
                        f"the check {bound.spec.id!r} is about {topic!r}, which the scenario "
                        f"{scenario.id!r} neither records nor sends.{did_you_mean(topic, known)}"
                    )


def _topics(parameters: Parameters, known: Collection[str]) -> list[str]:
    """The topics that should be there by what a check names."""
    topics = [getattr(parameters, key, None) for key in ("topic", "publishes")]
    if "topics" in parameters.model_fields_set:
        # A topic that must stay free need not be there; one with a nearly equal name is misspelt.
        topics += [name for name in getattr(parameters, "topics", ()) if did_you_mean(name, known)]
    return [topic for topic in topics if isinstance(topic, str)]


def _dependencies(assignment: Assignment) -> Iterator[str]:
    """Names under ``depends`` that seem not to exist."""
    own = {package.name for package in assignment.packages}
    for package in assignment.packages:
        for name in package.depends:
            if is_known(name, installed=(), submitted=own) is False:
                near = meant(name, own)
                advice = f" Did you mean {near!r}?" if near else ""
                yield (
                    f"the package {package.name!r} depends on {name!r}, which is not known as a "
                    f"package of ROS 2 Jazzy or a rosdep key.{advice}"
                )


def _shown_runs(loaded: LoadedAssignment) -> Iterator[str]:
    """Scenarios that only hidden checks name, but that a visible check without names judges."""
    visible, named_by_visible, named_by_hidden = [], set[str](), set[str]()
    for bound in loaded.checks:
        if bound.spec.visibility is Visibility.VISIBLE:
            visible.append(bound)
            named_by_visible.update(bound.spec.scenarios)
        else:
            named_by_hidden.update(bound.spec.scenarios)
    for bound in visible:
        for scenario in loaded.scenarios_of(bound):
            if scenario.id in named_by_hidden - named_by_visible:
                yield (
                    f"students see the run of the scenario {scenario.id!r}, although only hidden "
                    f"checks name it: the visible check {bound.spec.id!r} names no scenarios, so "
                    "it judges all"
                )
