"""A machine whose clock is set, or that runs out of memory in the middle of a run, is at fault."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest

from grader.recording.event import Breach
from grader.recording.model import Process
from grader.run.host import machine_faults
from grader.run.host.machine_faults import MachineFaults, ahead_ns

MS = 1_000_000
KILLED = Process("bot_publisher/bot_pub", 7, 0, 1, -9)
EXCESS = Breach(1, "memory", "1100 MiB of memory", "1024 MiB")


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Callable[..., MachineFaults]:
    """What the machine has between the beginning and the end of a run."""

    def make(name: str, *values: int | None) -> MachineFaults:
        monkeypatch.setattr(machine_faults, name, iter(values).__next__)
        return MachineFaults()

    return make


def test_a_clock_that_goes_on_is_no_fault(machine: Callable[..., MachineFaults]) -> None:
    assert MachineFaults().clock_was_set() is None
    assert machine("ahead_ns", 5, 5 + 9 * MS).clock_was_set() is None


@pytest.mark.parametrize(("step_ms", "said"), [(-1250, "back by 1.25 s"), (20, "forward by 0.02")])
def test_a_clock_that_is_set_is_a_fault(
    machine: Callable[..., MachineFaults], step_ms: int, said: str
) -> None:
    assert f"was set {said}" in str(machine("ahead_ns", 0, step_ms * MS).clock_was_set())


def test_a_reading_that_was_interrupted_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    walls = iter([1000, 1100, *[1000 + 200 * n for n in range(2, 40)]])
    steadies = iter([900, 150, *[200 * n for n in range(2, 40)]])
    monkeypatch.setattr(time, "time_ns", walls.__next__)
    monkeypatch.setattr(time, "monotonic_ns", steadies.__next__)
    assert ahead_ns() == 1000


def test_what_the_kernel_ends_for_want_of_memory_is_a_fault_of_the_machine(
    machine: Callable[..., MachineFaults],
) -> None:
    said = str(machine("oom_kills", 3, 5).out_of_memory([KILLED], ()))
    assert said.startswith("this machine ran out of memory in the middle of the run: ")
    assert "ended 2 of its processes, and bot_publisher/bot_pub was killed" in said


@pytest.mark.parametrize(
    ("kills", "process", "breaches"),
    [
        pytest.param((3, 3), KILLED, (), id="it killed itself"),
        pytest.param((None, None), KILLED, (), id="the kernel does not count"),
        pytest.param((3, 4), KILLED, (EXCESS,), id="it took too much"),
        pytest.param(
            (3, 4), Process("a/b", 7, 0, 1, -9, stopped_by="SIGKILL"), (), id="ended by us"
        ),
        pytest.param((3, 4), Process("a/b", 7, 0, 1, -11), (), id="a segmentation fault"),
    ],
)
def test_what_the_kernel_has_spared_is_judged(
    machine: Callable[..., MachineFaults],
    kills: tuple[int | None, ...],
    process: Process,
    breaches: tuple[Breach, ...],
) -> None:
    assert machine("oom_kills", *kills).out_of_memory([process], breaches) is None
