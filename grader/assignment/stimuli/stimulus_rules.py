"""What must fit in the stimuli of scenarios: their topics, processes, files and messages."""

from __future__ import annotations

from collections.abc import Iterator

from grader.assignment.interfaces import Interfaces
from grader.assignment.model import Assignment
from grader.assignment.random_values import draw_values
from grader.assignment.stimuli.stimulus_model import Making
from grader.errors import Problem
from grader.spec.document import Place
from grader.spec.source import Source
from grader.spec.unit import format_duration


def problems(source: Source, assignment: Assignment, known: Interfaces) -> Iterator[Problem]:
    """Find what does not fit; functions are tried with the seed 0.

    Fields of messages are checked where the definitions are at hand.
    """
    default = assignment.packages[0].name
    for index, scenario in enumerate(assignment.scenarios):
        launched = [f"{one.package or default}/{one.program}" for one in scenario.launch]
        drawn = draw_values(scenario, 0)
        making = Making(source.file.parent, known.find, 0, drawn, launched)
        for number, item in enumerate(scenario.stimuli):
            place: Place = ("scenarios", index, "stimuli", number)
            for inside, text in item.mistakes(making, scenario):
                yield source.problem((*place, *inside), text)
            after = getattr(item, "after", None)
            if after is not None and after >= scenario.timeout:
                shown, timeout = format_duration(after), format_duration(scenario.timeout)
                text = f"{shown} is not before the timeout of {timeout} ends the scenario"
                yield source.problem((*place, "after"), text)
        if scenario.until.stimuli is not None and not any(one.has_end for one in scenario.stimuli):
            text = "no stimulus of the scenario has an end"
            yield source.problem(("scenarios", index, "until", "stimuli"), text)
