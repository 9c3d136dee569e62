"""What must fit in the stimuli of scenarios: their topics, processes, files and messages."""

from __future__ import annotations

from collections.abc import Iterator

from grader.assignment.interfaces import Interfaces
from grader.assignment.model import Assignment, Scenario
from grader.assignment.random_values import draw_values
from grader.assignment.stimuli.kinds.join import Join
from grader.assignment.stimuli.kinds.process import Kill, Restart
from grader.assignment.stimuli.kinds.publish import Publish
from grader.assignment.stimuli.kinds.request import Request
from grader.assignment.stimuli.message import Find
from grader.assignment.stimuli.request_values import mistakes
from grader.assignment.stimuli.stimulus_messages import StimulusError, messages_of
from grader.errors import Problem
from grader.spec.document import Place
from grader.spec.nearest_name import did_you_mean
from grader.spec.source import Source
from grader.spec.unit import format_duration


def problems(source: Source, assignment: Assignment, known: Interfaces) -> Iterator[Problem]:
    """Find what does not fit; functions are tried with the seed 0.

    Fields of messages are checked where the definitions are at hand.
    """
    for index, scenario in enumerate(assignment.scenarios):
        names: set[str] = set()
        for number, item in enumerate(scenario.stimuli):
            place: Place = ("scenarios", index, "stimuli", number)
            if isinstance(item, Publish):
                yield from _publish(source, place, scenario, item, known.find)
            elif isinstance(item, Join):
                yield from _join(source, place, scenario, item, names)
            elif isinstance(item, Kill | Restart):
                yield from _process(source, place, item, assignment, scenario)
            elif isinstance(item, Request):
                for inside, text in mistakes(item, known.find, draw_values(scenario, 0)):
                    yield source.problem((*place, *inside), text)
            after = getattr(item, "after", None)
            if after is not None and after >= scenario.timeout:
                shown, timeout = format_duration(after), format_duration(scenario.timeout)
                text = f"{shown} is not before the timeout of {timeout} ends the scenario"
                yield source.problem((*place, "after"), text)
        if scenario.until.stimuli is not None and not any(one.has_end for one in scenario.stimuli):
            text = "no stimulus of the scenario has an end"
            yield source.problem(("scenarios", index, "until", "stimuli"), text)


def _publish(
    source: Source, place: Place, scenario: Scenario, item: Publish, find: Find
) -> Iterator[Problem]:
    recorded = scenario.recorded_types
    if item.publish in recorded:
        text = f"{item.publish!r} is recorded: only the student may publish there"
        yield source.problem((*place, "publish"), text)
    if item.answer is not None and item.answer not in recorded:
        advice = did_you_mean(item.answer, recorded)
        listed = f" It records: {', '.join(recorded) or 'nothing'}."
        text = f"the scenario does not record {item.answer!r}.{advice or listed}"
        yield source.problem((*place, "answer"), text)
    try:
        messages = messages_of(item, source.file.parent, find, 0, draw_values(scenario, 0))
    except StimulusError as error:
        yield source.problem((*place, *error.place), str(error))
    except KeyError:
        # Of a package that is not installed here.
        return
    else:
        if item.before_launch > len(messages):
            text = f"there are only {len(messages)} messages"
            yield source.problem((*place, "before_launch"), text)


def _join(
    source: Source, place: Place, scenario: Scenario, item: Join, names: set[str]
) -> Iterator[Problem]:
    if item.name in names:
        yield source.problem((*place, "name"), f"{item.name!r} stands twice")
    names.add(item.name)
    published = {one.publish for one in scenario.stimuli if isinstance(one, Publish)}
    if item.join in published:
        text = f"the probe publishes on {item.join!r} itself: a late joiner would hear that"
        yield source.problem((*place, "join"), text)


def _process(
    source: Source,
    place: Place,
    item: Kill | Restart,
    assignment: Assignment,
    scenario: Scenario,
) -> Iterator[Problem]:
    key = "kill" if isinstance(item, Kill) else "restart"
    executable, package = getattr(item, key), item.package
    default = assignment.packages[0].name
    launched = [(one.package or default, one.program) for one in scenario.launch]
    fitting = [name for name, known in launched if known == executable and package in (None, name)]
    if not fitting:
        listed = ", ".join(known for _, known in launched)
        advice = did_you_mean(executable, [known for _, known in launched])
        text = f"the scenario does not launch {executable!r}." + (advice or f" It has: {listed}.")
        yield source.problem((*place, key), text)
    elif len(fitting) > 1:
        text = f"{executable!r} is launched {len(fitting)} times: only one can be meant"
        yield source.problem((*place, key), text)
