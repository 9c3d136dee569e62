"""Which steps are due, on a clock that the test sets."""

from __future__ import annotations

from sim.pacing import LATE_NS, MAX_AHEAD, MAX_BATCH, Lateness, Pacer
from sim.simulation import STEP_NS


def test_a_step_is_due_when_its_time_is_over() -> None:
    pacer = Pacer(1000)
    assert pacer.deadline_ns == 1000 + STEP_NS
    assert pacer.due(1000 + STEP_NS - 1) == 0
    assert pacer.due(1000 + STEP_NS) == 1
    pacer.done += 1
    assert pacer.due(1000 + STEP_NS) == 0
    assert pacer.plan(2 * STEP_NS) == 1000 + 2 * STEP_NS


def test_missed_steps_are_all_due_but_not_all_at_once() -> None:
    pacer = Pacer(0)
    pacer.done += 3
    assert pacer.due(10 * STEP_NS) == 7
    assert pacer.due(10 * MAX_BATCH * STEP_NS) == MAX_BATCH
    assert pacer.due(-1000) == 0


def test_what_is_late_is_reported() -> None:
    pacer = Pacer(0)
    assert pacer.lateness(STEP_NS + LATE_NS) is None
    assert pacer.lateness(STEP_NS + LATE_NS + 1) == Lateness(1, 1, LATE_NS + 1)
    pacer.done += 1
    pacer.plan(4 * STEP_NS)
    assert pacer.lateness(4 * STEP_NS) is None
    assert pacer.lateness(5 * STEP_NS) == Lateness(2, 4, STEP_NS)


def test_it_looks_again_when_something_is_to_be_seen() -> None:
    pacer = Pacer(1000)
    pacer.done += 10
    assert pacer.plan(13 * STEP_NS) == 1000 + 13 * STEP_NS
    assert pacer.plan(0) == 1000 + 11 * STEP_NS
    assert pacer.plan(100 * STEP_NS) == 1000 + (10 + MAX_AHEAD) * STEP_NS
    assert pacer.plan(None) == 1000 + (10 + MAX_AHEAD) * STEP_NS
