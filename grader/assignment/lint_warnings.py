"""What is valid in an assignment but looks like a mistake: told by ``rosgrade validate``. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from pydantic import BaseModel

from grader.assignment.load import LoadedAssignment
from grader.assignment.model import Assignment, Scenario, Visibility
from grader.assignment.mutant import Mutant
from grader.assignment.stimuli.kinds.join import Join
from grader.assignment.stimuli.kinds.publish import Publish
from grader.checks.need import Recorded
from grader.checks.tolerance import TimeTolerance
from grader.checks.wording import percent
from grader.spec.nearest_name import did_you_mean
from grader.spec.quantity import QuantityOf
from grader.spec.unit import Dimension, format_duration
from grader.submission.read.dependencies import is_known, meant


def lint_warnings(loaded: LoadedAssignment, mutants: Sequence[Mutant] | None) -> Iterator[str]:
    """Find what an author should look at once more.

    Args:
        mutants: Its mutants, or None where it has no such file.
    """
    yield from _unknown_topics(loaded)
    yield from _shown_runs(loaded)
    yield from _short_runs(loaded)
    yield from _tolerances(loaded)
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
        named = [getattr(bound.parameters, key, None) for key in ("topic", "publishes")]
        # Topics that nobody may publish on need not be there, but one that nearly is, is misspelt.
        stated = "topics" in bound.parameters.model_fields_set
        kept_off = getattr(bound.parameters, "topics", ()) if stated else ()
        for scenario in loaded.scenarios_of(bound):
            known = _topics(scenario)
            suspects = [name for name in named if isinstance(name, str)]
            suspects += [name for name in kept_off if did_you_mean(name, known)]
            for topic in suspects:
                if topic not in known:
                    yield (
                        f"the check {bound.spec.id!r} is about {topic!r}, which the scenario "
                        f"{scenario.id!r} neither records nor sends.{did_you_mean(topic, known)}"
                    )


def _short_runs(loaded: LoadedAssignment) -> Iterator[str]:
    """Runs that end before there can be as many messages as a check needs."""
    for bound in loaded.checks:
        number = next((n for n in bound.parameters.needs if isinstance(n, Recorded)), Recorded())
        if number.at_least is None:
            continue
        needed = getattr(bound.parameters, number.at_least)
        period_s = getattr(bound.parameters, number.period) if number.period else 0.0
        for scenario in loaded.scenarios_of(bound):
            ends = ""
            if scenario.until.model_fields_set == {"messages"} and len(scenario.record) == 1:
                most = scenario.until.messages or needed
                ends = f"{most} messages" if most < needed else ""
            if needed * period_s > scenario.timeout:
                ends = format_duration(scenario.timeout)
            if ends:
                every = f", one every {format_duration(period_s)}" if period_s else ""
                yield (
                    f"the check {bound.spec.id!r} needs {needed} messages{every}, but the scenario "
                    f"{scenario.id!r} ends after {ends}"
                )


def _tolerances(loaded: LoadedAssignment) -> Iterator[str]:
    """Tolerances that nothing meets, or that nothing misses."""
    for bound in loaded.checks:
        # What a tolerance means in a check of the author's own is theirs to know.
        if bound.spec.python is not None:
            continue
        for key in sorted(bound.parameters.model_fields_set):
            share = _share(bound.parameters, key)
            told = f"the check {bound.spec.id!r} has {key!r} {percent(share or 0.0)}"
            if share == 0.0:
                yield f"{told}: what is measured is never exact, so right programs fail it"
            elif share is not None and share >= 1.0:
                yield f"{told}: so wide that even next to 0 is near enough"


def _share(parameters: BaseModel, key: str) -> float | None:
    """A tolerance as a share of what is expected; None for what is none, or cannot be one."""
    value = getattr(parameters, key)
    if isinstance(value, TimeTolerance):
        expected_s = getattr(parameters, "period", None) or getattr(parameters, "duration", None)
        if value.relative or value.amount == 0.0:
            return value.amount
        return value.amount / expected_s if expected_s else None
    form = type(parameters).model_fields[key].metadata
    is_ratio = any(isinstance(o, QuantityOf) and o.dimension is Dimension.RATIO for o in form)
    return value if is_ratio and key.endswith("tolerance") else None


def _dependencies(assignment: Assignment) -> Iterator[str]:
    """What a solution is said to need, and that seems not to exist."""
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
    """Runs that are named for hidden checks alone, but that a visible check judges unnamed."""
    visible = [b for b in loaded.checks if b.spec.visibility is Visibility.VISIBLE]
    hidden = [b for b in loaded.checks if b.spec.visibility is not Visibility.VISIBLE]
    named = {scenario for bound in visible for scenario in bound.spec.scenarios}
    meant = {scenario for bound in hidden for scenario in bound.spec.scenarios} - named
    for bound in visible:
        for scenario in loaded.scenarios_of(bound):
            if scenario.id in meant:
                yield (
                    f"students see the run of the scenario {scenario.id!r}, which only hidden "
                    f"checks name: the visible check {bound.spec.id!r} names no scenarios, and so "
                    "judges all"
                )


def _topics(scenario: Scenario) -> set[str]:
    sent = {one.publish for one in scenario.stimuli if isinstance(one, Publish)}
    joined = {one.join for one in scenario.stimuli if isinstance(one, Join)}
    return {*scenario.recorded_types, *sent, *joined}
