"""Which runs follow on what happened: a table, without a process."""

from __future__ import annotations

import pytest

from grader.assignment.model import Scenario
from grader.grading.next_runs import MOST_ROUNDS, Round, Run, next_runs, times_run
from grader.spec.names import Names, Thing, WrongName

SHORT = Scenario(id="short", launch=[{"executable": "bot"}], timeout="1 s")
LONG = Scenario(id="long", launch=[{"executable": "bot"}], timeout="9 s")
BOTH = (SHORT, LONG)
WRONG = Names.of([WrongName(Thing.TOPIC, "/cmdvel", "/cmd_vel")])
OTHER = Names.of([WrongName(Thing.NODE, "/bott", "/bot")])
BUILT = Round(BOTH)
FIRST = (Run(LONG), Run(SHORT))
DOUBT, STUCK = "failed on a disturbed machine", "too disturbed"


def after(*runs: Run, scenarios=BOTH, **said) -> Round:
    return Round(scenarios, runs, **said)


@pytest.mark.parametrize(
    ("rounds", "runs"),
    [
        # Each scenario is run once, the longest first; nothing is, where nothing was built.
        ([BUILT], FIRST),
        ([Round(())], ()),
        ([BUILT, after(*FIRST)], ()),
        # A name that is wrong in what was built is put right in the first run.
        ([Round(BOTH, names={"short": WRONG})], (Run(LONG), Run(SHORT, WRONG))),
        # One that a run shows is put right in the next, of this scenario only.
        ([BUILT, after(*FIRST, names={"long": WRONG})], (Run(LONG, WRONG),)),
        # A run that puts a name right shows it no more: it stays known.
        (
            [BUILT, after(*FIRST, names={"long": WRONG}), after(Run(LONG, WRONG))],
            (),
        ),
        (
            [
                BUILT,
                after(*FIRST, names={"long": WRONG}),
                after(Run(LONG, WRONG), names={"long": OTHER}),
            ],
            (Run(LONG, WRONG | OTHER),),
        ),
        # A scenario that asks for another name, because a run told it, is run as it is now.
        (
            [BUILT, after(*FIRST, scenarios=(SHORT, LONG.model_copy(update={"timeout": 5.0})))],
            (Run(LONG.model_copy(update={"timeout": 5.0})),),
        ),
        # What could not be judged is run alone, what failed on a disturbed machine is not.
        (
            [BUILT, after(*FIRST, undecided={"short": STUCK}, doubtful=("long", "short"))],
            (Run(LONG, why=DOUBT), Run(SHORT, why=STUCK, alone=True)),
        ),
        # Names come first: they may be why it could not be judged.
        (
            [BUILT, after(*FIRST, names={"long": WRONG}, undecided={"short": STUCK})],
            (Run(LONG, WRONG),),
        ),
        # After a run for the machine a failure counts, and after one for names it does not yet.
        (
            [
                BUILT,
                after(*FIRST, doubtful=("long",)),
                after(Run(LONG, why=DOUBT), doubtful=("long",)),
            ],
            (),
        ),
        (
            [
                BUILT,
                after(*FIRST, names={"long": WRONG}),
                after(Run(LONG, WRONG), doubtful=("long",)),
            ],
            (Run(LONG, WRONG, DOUBT),),
        ),
    ],
)
def test_what_is_run_next(rounds, runs):
    assert next_runs(rounds) == runs


def test_no_scenario_is_tried_for_ever():
    rounds = [BUILT]
    while runs := next_runs(rounds):
        rounds.append(after(*runs, undecided={"short": STUCK}))
    assert len(rounds) == 1 + MOST_ROUNDS
    assert times_run(rounds) == {"long": 1, "short": MOST_ROUNDS}


def test_a_run_that_puts_a_name_right_is_no_repetition():
    rounds = [BUILT, after(*FIRST, names={"long": WRONG}), after(Run(LONG, WRONG))]
    assert times_run(rounds) == {"long": 1, "short": 1}
