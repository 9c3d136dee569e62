"""From the stimuli of a scenario to the orders of its cell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from grader.errors import GraderFault
from grader.recording.definition import definition_finder
from grader.run.order import Command
from grader.run.stimuli.orders import (
    CallOrder,
    GoalOrder,
    JoinOrder,
    KillOrder,
    ListParametersOrder,
    ParametersOrder,
    PublishOrder,
    RestartOrder,
    StimulusOrder,
)

if TYPE_CHECKING:
    from grader.assignment.model import Scenario
    from grader.assignment.stimuli.request import Request
    from grader.assignment.stimuli.stimulus import Join, Publish


def stimulus_orders(
    scenario: Scenario,
    commands: Sequence[Command],
    folder: Path,
    prefixes: Sequence[str],
    seed: int,
    drawn: Mapping[str, float],
) -> tuple[StimulusOrder, ...]:
    """Make the orders.

    Raises:
        GraderFault: A message of a stimulus cannot be made.
    """
    from grader.assignment.stimuli import request as asking
    from grader.assignment.stimuli import stimulus

    found: list[StimulusOrder] = []
    for item in scenario.stimuli:
        if isinstance(item, stimulus.Publish):
            found.append(_publish(item, folder, prefixes, seed, drawn))
        elif isinstance(item, stimulus.Join):
            found.append(_join(item))
        elif isinstance(item, stimulus.Kill):
            process = _process(item.kill, item.package, commands)
            found.append(KillOrder(process, item.signal, item.after))
        elif isinstance(item, stimulus.Restart):
            found.append(RestartOrder(_process(item.restart, item.package, commands), item.after))
        elif isinstance(item, asking.ListParameters):
            found.append(ListParametersOrder(item.every))
        else:
            found.append(_asking(item, prefixes, drawn))
    return tuple(found)


def _publish(
    item: Publish,
    folder: Path,
    prefixes: Sequence[str],
    seed: int,
    drawn: Mapping[str, float],
) -> PublishOrder:
    from grader.assignment.stimuli.stimulus_messages import StimulusError, messages_of

    find = definition_finder(Path(prefix) for prefix in prefixes)
    try:
        due = messages_of(item, folder, find, seed, drawn)
    except StimulusError as error:
        raise GraderFault(f"the stimulus on {item.publish}: {error}") from error
    except KeyError as error:
        raise GraderFault(
            f"the stimulus on {item.publish}: no definition of {error.args[0]} was found"
        ) from error
    endless = item.message is not None and item.every is not None and item.count is None
    return PublishOrder(
        topic=item.publish,
        type=item.type,
        reliability=item.reliability,
        durability=item.durability,
        depth=item.depth,
        messages=tuple(one.value for one in due),
        times_s=tuple(one.time_s for one in due),
        before_launch=item.before_launch,
        after_s=item.after,
        repeat_s=item.every if endless else None,
        answer=item.answer,
        within_s=item.within,
    )


def _asking(item: Request, prefixes: Sequence[str], drawn: Mapping[str, float]) -> StimulusOrder:
    from grader.assignment.stimuli.request import CallService, ReadParameters, SetParameters
    from grader.assignment.stimuli.request_values import goal_of, requests_of, values_of
    from grader.assignment.stimuli.stimulus_messages import StimulusError

    find = definition_finder(Path(prefix) for prefix in prefixes)
    try:
        if isinstance(item, CallService):
            return CallOrder(
                item.call,
                item.type,
                requests_of(item, find, drawn),
                item.at_once,
                item.after,
                item.every,
                item.within,
            )
        if isinstance(item, ReadParameters):
            return ParametersOrder(item.read_parameters, {}, item.after, item.within)
        if isinstance(item, SetParameters):
            return ParametersOrder(item.node, values_of(item, drawn), item.after, item.within)
        return GoalOrder(
            item.send_goal,
            item.type,
            goal_of(item, find, drawn),
            item.after,
            item.cancel_after,
            item.preempt,
            item.within,
        )
    except StimulusError as error:
        raise GraderFault(f"a stimulus cannot be played: {error}") from error
    except KeyError as error:
        raise GraderFault(
            f"a stimulus cannot be played: no definition of {error.args[0]} was found"
        ) from error


def _join(item: Join) -> JoinOrder:
    return JoinOrder(
        name=item.name,
        topic=item.join,
        type=item.type,
        reliability=item.reliability,
        durability=item.durability,
        depth=item.depth,
        after_s=item.after,
    )


def _process(executable: str, package: str | None, commands: Sequence[Command]) -> str:
    for command in commands:
        its_package, _, its_executable = command.name.partition("/")
        if its_executable == executable and package in (None, its_package):
            return command.name
    raise GraderFault(f"a stimulus names {executable!r}, which the scenario does not launch")
