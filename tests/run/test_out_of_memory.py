"""A machine that runs out of memory costs nobody a point."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from grader.recording.event import Breach
from grader.recording.model import Process
from grader.run.host.memory_shortage import Shortage

KILLED = Process("bot_publisher/bot_pub", 7, 0, 1, -9)


def machine(*kills: int | None) -> Callable[[], int | None]:
    """What the kernel has ended so far, each time that it is asked."""
    return iter(kills).__next__


def test_what_the_kernel_ends_for_want_of_memory_is_a_fault_of_the_machine() -> None:
    said = Shortage(machine(3, 5)).fault([KILLED], ())
    assert said is not None
    assert said.startswith("this machine ran out of memory in the middle of the run: ")
    assert "ended 2 of its processes, and bot_publisher/bot_pub was killed" in said


@pytest.mark.parametrize("kills", [(3, 3), (None, None)])
def test_whoever_kills_himself_has_no_excuse(kills: tuple[int | None, ...]) -> None:
    assert Shortage(machine(*kills)).fault([KILLED], ()) is None


def test_whoever_took_too_much_was_ended_by_us() -> None:
    breach = Breach(1, "memory", "1100 MiB of memory", "1024 MiB")
    assert Shortage(machine(3, 4)).fault([KILLED], (breach,)) is None


@pytest.mark.parametrize(
    "process",
    [
        Process("bot_publisher/bot_pub", 7, 0, 1, -9, stopped_by="SIGKILL"),
        Process("bot_publisher/bot_pub", 7, 0, 1, -11),
        Process("bot_publisher/bot_pub", 7, 0, 1, 0, stopped_by="SIGINT"),
    ],
)
def test_whom_the_kernel_has_spared_is_judged(process: Process) -> None:
    assert Shortage(machine(3, 4)).fault([process], ()) is None


def test_this_machine_can_be_asked() -> None:
    assert Shortage().fault([], ()) is None
