"""From the stimuli of a scenario to the orders of its cell: plain JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grader.errors import GraderFault
from grader.recording.interface import definition_finder
from grader.run.order import ProcessCommand

if TYPE_CHECKING:
    from grader.assignment.model import Scenario


def stimulus_orders(
    scenario: Scenario,
    commands: Sequence[ProcessCommand],
    folder: Path,
    prefixes: Sequence[str],
    seed: int,
    drawn: Mapping[str, float],
) -> tuple[dict[str, Any], ...]:
    """Make the orders."""
    from grader.assignment.stimuli.message import StimulusError
    from grader.assignment.stimuli.stimulus_model import Making

    find = definition_finder(Path(prefix) for prefix in prefixes)
    making = Making(folder, find, seed, drawn, [command.name for command in commands])
    found = []
    for item in scenario.stimuli:
        what = f"the stimulus {item.key!r}" + (f" on {item.exchanged[0]}" if item.exchanged else "")
        try:
            found.append(item.order(making))
        except StimulusError as error:
            raise GraderFault(f"{what}: {error}") from error
        except KeyError as error:
            raise GraderFault(f"{what}: no definition of {error.args[0]} was found") from error
    return tuple(found)
