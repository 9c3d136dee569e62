"""A clock that is set in the middle of a run spoils every time that was recorded in it."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from grader.run.host.wall_clock import WallClock

MS = 1_000_000


class Machine:
    """Its two clocks; a reading takes a while."""

    def __init__(self, boot_ns: int, reading_ns: int) -> None:
        self.steady_ns = boot_ns
        self.ahead_ns = 1_795_000_000_000_000_000
        self.reading_ns = reading_ns

    def wall(self) -> int:
        return self.steady() + self.ahead_ns

    def steady(self) -> int:
        self.steady_ns += self.reading_ns
        return self.steady_ns


@given(st.integers(0, 10**15), st.integers(1, MS), st.integers(0, 10**12))
def test_a_clock_that_only_goes_on_is_no_fault(boot_ns: int, reading_ns: int, run_ns: int) -> None:
    machine = Machine(boot_ns, reading_ns)
    clock = WallClock(machine.wall, machine.steady)
    machine.steady_ns += run_ns
    assert clock.fault is None


@given(st.integers(15, 10**9), st.sampled_from([1, -1]), st.integers(1, MS))
def test_a_clock_that_is_set_is_one(step_ms: int, sign: int, reading_ns: int) -> None:
    machine = Machine(0, reading_ns)
    clock = WallClock(machine.wall, machine.steady)
    machine.ahead_ns += sign * step_ms * MS
    said = clock.fault
    assert said is not None
    assert ("forward" if sign > 0 else "back") in said


def test_the_fault_says_how_much() -> None:
    machine = Machine(0, 100)
    clock = WallClock(machine.wall, machine.steady)
    machine.ahead_ns -= 1250 * MS
    assert "was set back by 1.25 s in the middle of the run" in str(clock.fault)


def test_the_clock_of_this_machine_goes_on() -> None:
    assert WallClock().fault is None
