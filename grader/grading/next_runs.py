"""What is run next, and why: a pure function of what happened. Nothing else repeats a run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

from grader.assignment.model import Scenario
from grader.spec.names import NO_NAMES, Names

MOST_ROUNDS = 3
"""Rounds of runs before a scenario is given up as disturbed."""


@dataclass(frozen=True)
class Run:
    """One run of a scenario.

    Attributes:
        names: Wrong names of the student's that it puts right.
        why: Why the run before is not enough, where the machine or rosgrade is to blame for that.
        alone: Whether nothing else is to run beside it.
    """

    scenario: Scenario
    names: Names = NO_NAMES
    why: str = ""
    alone: bool = False


@dataclass(frozen=True)
class Round:
    """Runs that were made together, and what judging says after them.

    Attributes:
        runs: Empty in the first round, which judges only what was built.
        scenarios: With the names that are known by now; none where nothing can be run.
        names: By scenario id, wrong names that a run has to put right.
        undecided: By scenario id, why it could not be judged.
        doubtful: Ids of scenarios in which something failed, perhaps because of the machine.
    """

    scenarios: Sequence[Scenario]
    runs: Sequence[Run] = ()
    names: Mapping[str, Names] = field(default_factory=dict)
    undecided: Mapping[str, str] = field(default_factory=dict)
    doubtful: Collection[str] = ()


def next_runs(rounds: Sequence[Round]) -> tuple[Run, ...]:
    """The runs to make after some rounds; none where all is decided, or no more is tried.

    1. A scenario that was not run yet with all names that are known by now is run with them. The
       longest start first: none of them is left to run alone in the end.
    2. Else, one that could not be judged is run again with nothing beside it,
    3. and one that failed on a disturbed machine once more. A failure that happens twice is no
       accident, and need not be seen on a quiet machine.
    """
    if len(rounds) > MOST_ROUNDS:
        return ()
    last, before = rounds[-1], _last_runs(rounds)
    runs = {scenario.id: Run(scenario, _names(scenario, rounds)) for scenario in last.scenarios}
    new = [run for name, run in runs.items() if _is_new(run, before.get(name))]
    if new:
        return tuple(sorted(new, key=lambda run: -run.scenario.timeout))
    again = [
        replace(run, why="failed on a disturbed machine")
        for name, run in runs.items()
        if name in last.doubtful and name not in last.undecided
    ]
    alone = [
        replace(run, why=last.undecided[name], alone=True)
        for name, run in runs.items()
        if name in last.undecided
    ]
    is_repeated = any(run.why for run in last.runs)
    return tuple(alone if is_repeated else again + alone)


def times_run(rounds: Sequence[Round]) -> dict[str, int]:
    """How often each scenario was run since its names are known."""
    times: Counter[str] = Counter()
    for one in rounds:
        for run in one.runs:
            # A run that only puts names right begins anew.
            times[run.scenario.id] = times[run.scenario.id] + 1 if run.why else 1
    return dict(times)


def _last_runs(rounds: Sequence[Round]) -> dict[str, Run]:
    return {run.scenario.id: run for one in rounds for run in one.runs}


def _names(scenario: Scenario, rounds: Sequence[Round]) -> Names:
    """All wrong names of a scenario, of any round: a run that puts one right no longer shows it."""
    names = NO_NAMES
    for one in rounds:
        names = names | one.names.get(scenario.id, NO_NAMES)
    return names


def _is_new(run: Run, before: Run | None) -> bool:
    return before is None or run.scenario != before.scenario or not run.names.all_in(before.names)
