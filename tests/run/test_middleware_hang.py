"""Whether what a student sends keeps the cell waiting for its own middleware."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from grader.assignment.load import list_assignments, load_assignment
from grader.assignment.model import Scenario
from grader.checks.check import Subject
from grader.checks.parameter.parameter import PARAMETERS_GIVEN
from grader.findings.finding import Status
from grader.grade.judging import judge_all
from grader.run.cell.middleware_hang import ENDED_BY, HangMonitor, hung_recording
from grader.run.order import CellOrder, ProcessCommand, RunLimits, UntilOrder
from tests.checks.builder import submission


@dataclass
class Cell:
    """What ``/proc`` tells of a process with a thread of its own and one that receives."""

    folder: Path

    def is_seen(self, *, state: str = "S", switches: int, received_s: float) -> None:
        (self.folder / "task" / "2").mkdir(parents=True, exist_ok=True)
        (self.folder / "status").write_text(
            f"Name:\tpython\nState:\t{state} (...)\nvoluntary_ctxt_switches:\t{switches}\n"
            "nonvoluntary_ctxt_switches:\t7\n"
        )
        fields = ["R", *["0"] * 10, str(int(received_s * 100)), "0", *["0"] * 30]
        (self.folder / "task" / "2" / "stat").write_text(f"2 (dds.udp.7411) {' '.join(fields)}\n")


@pytest.fixture
def cell(tmp_path: Path) -> Cell:
    return Cell(tmp_path)


def test_a_middleware_that_works_without_end_is_noticed(cell: Cell) -> None:
    monitor = HangMonitor(cell.folder)
    cell.is_seen(switches=50, received_s=3.0)
    assert monitor.signal_to_send() is None
    cell.is_seen(switches=50, received_s=7.0)
    assert monitor.signal_to_send() is None
    cell.is_seen(switches=50, received_s=8.5)
    assert monitor.signal_to_send() is ENDED_BY


@pytest.mark.parametrize(("state", "more_switches"), [("S", 1), ("R", 0)])
def test_a_cell_that_goes_on_or_waits_for_a_cpu_does_not_hang(
    cell: Cell, state: str, more_switches: int
) -> None:
    monitor = HangMonitor(cell.folder)
    for look in range(20):
        switches = 50 + look * more_switches
        cell.is_seen(state=state, switches=switches, received_s=4.0 * look)
        assert monitor.signal_to_send() is None


def test_a_cell_that_has_ended_does_not_hang(cell: Cell) -> None:
    monitor = HangMonitor(cell.folder / "ended")
    assert monitor.signal_to_send() is monitor.signal_to_send() is None


def order(scenario: Scenario) -> CellOrder:
    """One of which only matters what a recording takes over."""
    return CellOrder(
        scenario=scenario.id,
        seed=0,
        commands=tuple(ProcessCommand(launch.program, ()) for launch in scenario.launch),
        student_environment={},
        prefixes=(),
        topics=(),
        stimuli=(),
        until=UntilOrder(),
        limits=RunLimits(1.0, 1.0, 1.0),
        scratch="",
        submission="",
    )


@pytest.mark.parametrize("name", list_assignments())
def test_no_check_takes_a_run_that_hung_for_a_fault_of_rosgrade(name: str) -> None:
    loaded = load_assignment(name)
    # Each by itself, not skipped for what another one would say before it.
    alone = [
        replace(bound, spec=bound.spec.model_copy(update={"requires": ()}))
        for bound in loaded.checks
        # Of a node that answers nothing this one says nothing: those that it requires do.
        if bound.check.subject is Subject.RECORDING and bound.check.name != PARAMETERS_GIVEN
    ]
    recordings = {
        scenario.id: hung_recording(order(scenario), submission(), 0)
        for scenario in loaded.assignment.scenarios
    }
    results = judge_all(replace(loaded, checks=tuple(alone)), submission(), recordings).results
    assert {
        result.id: result.status for result in results if result.status is not Status.FAILED
    } == {}
