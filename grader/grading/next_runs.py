"""What is run next, and why: a pure function of what happened. Nothing else repeats a run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

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
    wanted = {one.id: Run(one, _names(one, rounds)) for one in last.scenarios}
    named = [run for name, run in wanted.items() if _is_new(run, before.get(name))]
    if named:
        return tuple(sorted(named, key=lambda run: -run.scenario.timeout))
    again = [
        Run(run.scenario, run.names, "failed on a disturbed machine")
        for name, run in wanted.items()
        if name in last.doubtful and name not in last.undecided
    ]
    alone = [
        Run(run.scenario, run.names, last.undecided[name], alone=True)
        for name, run in wanted.items()
        if name in last.undecided
    ]
    return (*(again if not any(run.why for run in last.runs) else ()), *alone)


def times_run(rounds: Sequence[Round]) -> dict[str, int]:
    """How often each scenario was run since its names are known."""
    found: Counter[str] = Counter()
    for one in rounds:
        for run in one.runs:
            found[run.scenario.id] = 1 + (found[run.scenario.id] if run.why else 0)
    return dict(found)


def _last_runs(rounds: Sequence[Round]) -> dict[str, Run]:
    return {run.scenario.id: run for one in rounds for run in one.runs}


def _names(scenario: Scenario, rounds: Sequence[Round]) -> Names:
    """All wrong names of a scenario, of any round: a run that puts one right no longer shows it."""
    found = NO_NAMES
    for one in rounds:
        found = found | one.names.get(scenario.id, NO_NAMES)
    return found


def _is_new(run: Run, before: Run | None) -> bool:
    return before is None or run.scenario != before.scenario or not run.names <= before.names
