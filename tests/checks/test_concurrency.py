"""executor.overlap: whether callbacks run at the same time, by what they log."""

import pytest

from grader.findings.finding import Status
from grader.recording.model import LogLine
from tests.checks.builder import BOT, at, declarations, failing, judge, recording, taken

BOTH = {"callbacks": ["timer_1", "chatter"], "log": ["start", "end"]}
ONE = {"callbacks": ["timer_1"], "log": ["start", "end"]}
AT_ONCE = ("timer_1 start", "chatter start", "timer_1 end", "chatter end")
IN_TURN = ("timer_1 start", "timer_1 end", "chatter start", "chatter end")


def printed(*texts, **changes):
    """A run whose program prints these lines, a tenth of a second apart."""
    lines = [LogLine(at(1 + n / 10), BOT, "stdout", text) for n, text in enumerate(texts)]
    return recording(log=tuple(lines), **changes)


@pytest.mark.parametrize("known", [declarations(), ()])
def test_callbacks_that_log_are_judged_in_any_language(known):
    once, turn = (printed(*lines * 2, declarations=known) for lines in (AT_ONCE, IN_TURN))
    finding = judge("executor.overlap", once, **BOTH)
    assert finding.status is Status.PASSED
    assert "4 runs: `timer_1` overlaps 2 times and `chatter` overlaps 2 times" in finding.observed
    assert {span.name for span in finding.evidence.spans} == {"timer_1", "chatter"}
    assert judge("executor.overlap", turn, **BOTH, never=True).status is Status.PASSED
    failing("executor.overlap", once, **BOTH, never=True)
    assert "the node's default group" in failing("executor.overlap", turn, **BOTH)


def test_lines_may_say_more_and_other_lines_do_not_count():
    once = printed(
        "Start of timer_1", "timer_12 start", "chatter: START", "timer_1 will start and end",
        "timer_1 end", "chatter: end.", "restart of chatter",
    )  # fmt: skip
    assert judge("executor.overlap", once, **BOTH, at_least=1).status is Status.PASSED


def test_a_callback_may_overlap_itself():
    itself = printed(*["timer_1 start"] * 3, *["timer_1 end"] * 3)
    assert judge("executor.overlap", itself, **ONE).status is Status.PASSED
    failing("executor.overlap", itself, **ONE, never=True)


def test_of_two_callbacks_each_overlaps_with_the_other():
    itself = printed(*["timer_1 start"] * 3, *["timer_1 end"] * 3, "chatter start", "chatter end")
    failing("executor.overlap", itself, **BOTH)


def test_what_the_machine_may_have_prevented_is_repeated():
    held_up = (*taken(1.0, 1.15, 0.17), *taken(1.4, 1.55, 0.17))
    finding = judge("executor.overlap", printed(*IN_TURN * 2, disturbance=held_up), **BOTH)
    assert finding.status is Status.ERROR and finding.disturbed
    failing("executor.overlap", printed(*IN_TURN * 2, disturbance=held_up[:2]), **BOTH)


def test_a_callback_that_does_not_end_is_told():
    found = failing("executor.overlap", printed("timer_1 start", "chatter start"), **BOTH)
    assert "`chatter` ran 0 times, of 1 that are needed" in found


def test_a_node_that_never_spins_is_told_so():
    one = recording(declarations=declarations(spin=False))
    assert "rclpy.spin() was never called" in failing("executor.overlap", one, **BOTH)
