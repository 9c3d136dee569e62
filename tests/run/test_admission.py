"""Cells are admitted within bounds, starts are spread, and "alone" means alone."""

from __future__ import annotations

import resource
import subprocess
import sys
import threading
import time

import pytest

from grader.run.admission import Admission
from grader.run.load import Load, cpu_count

LIMIT_S = 10.0


class Visitor(threading.Thread):
    """Takes a place, says so, and keeps it until it is told to go."""

    def __init__(self, admission: Admission, *, alone: bool = False, starts: bool = True) -> None:
        super().__init__(daemon=True)
        self.admission = admission
        self.alone = alone
        self.starts = starts
        self.inside = threading.Event()
        self.leave = threading.Event()
        self.start()

    def run(self) -> None:
        with self.admission.cell(alone=self.alone) as ticket:
            if self.starts:
                ticket.started()
            self.inside.set()
            self.leave.wait(LIMIT_S)

    def is_inside(self) -> bool:
        return self.inside.wait(LIMIT_S)

    def go(self) -> None:
        self.leave.set()
        self.join(LIMIT_S)


def test_no_more_than_the_bound_are_inside() -> None:
    admission = Admission(cells=2, starts=2)
    first, second = Visitor(admission), Visitor(admission)
    assert first.is_inside() and second.is_inside()
    third = Visitor(admission)
    assert not third.inside.wait(0.1)
    first.go()
    assert third.is_inside()
    second.go()
    third.go()


def test_the_next_starts_when_one_has_started() -> None:
    admission = Admission(cells=8, starts=1)
    first = Visitor(admission, starts=False)
    assert first.is_inside()
    second = Visitor(admission)
    assert not second.inside.wait(0.1)
    first.go()
    assert second.is_inside()
    second.go()


def test_alone_waits_for_the_others_and_keeps_them_out() -> None:
    admission = Admission(cells=8, starts=8)
    first = Visitor(admission)
    assert first.is_inside()
    lonely = Visitor(admission, alone=True)
    assert not lonely.inside.wait(0.1)
    first.go()
    assert lonely.is_inside()
    later = Visitor(admission)
    assert not later.inside.wait(0.1)
    lonely.go()
    assert later.is_inside()
    later.go()


class Busy(Load):
    """A machine with so many runnable threads, and this share of its memory free."""

    def __init__(self, threads: float, memory: float = 1.0) -> None:
        super().__init__()
        self.threads = threads
        self.memory = memory

    def runnable(self) -> float:
        return self.threads

    def free_memory(self) -> float:
        return self.memory


def test_a_busy_machine_takes_one_cell_for_each_cpu() -> None:
    load = Busy(100.0)
    admission = Admission(starts=100, load=load)
    inside = [Visitor(admission) for _ in range(cpu_count())]
    assert all(visitor.is_inside() for visitor in inside)
    one_more = Visitor(admission)
    assert not one_more.inside.wait(0.2)
    load.threads = 0.0
    assert one_more.is_inside()
    for visitor in (*inside, one_more):
        visitor.go()


def test_a_machine_short_of_memory_takes_one_cell_for_each_cpu() -> None:
    load = Busy(0.0, memory=0.05)
    admission = Admission(starts=100, load=load)
    inside = [Visitor(admission) for _ in range(cpu_count())]
    assert all(visitor.is_inside() for visitor in inside)
    one_more = Visitor(admission)
    assert not one_more.inside.wait(0.2)
    load.memory = 0.5
    assert one_more.is_inside()
    for visitor in (*inside, one_more):
        visitor.go()


def test_the_free_memory_is_a_share() -> None:
    assert 0.0 < Load().free_memory() < 1.0


def test_the_load_counts_threads_of_the_whole_machine() -> None:
    load = Load()
    burner = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    try:
        deadline = time.monotonic() + LIMIT_S
        while load.runnable() < 0.5:
            assert time.monotonic() < deadline
            time.sleep(0.05)
    finally:
        burner.kill()
        burner.wait()


@pytest.mark.parametrize(
    ("soft", "hard", "most", "then"),
    [
        (1024, 1_048_576, 400, 1856),
        (1024, 1024, 192, 1024),
        (1024, resource.RLIM_INFINITY, 400, 1856),
        (4096, 4096, 400, 4096),
        (resource.RLIM_INFINITY, resource.RLIM_INFINITY, 400, resource.RLIM_INFINITY),
        (64, 64, 1, 64),
    ],
)
def test_no_more_cells_than_there_are_descriptors_for(
    soft: int, hard: int, most: int, then: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    limits = [(soft, hard)]
    monkeypatch.setattr(resource, "getrlimit", lambda _: limits[-1])
    monkeypatch.setattr(resource, "setrlimit", lambda _, pair: limits.append(pair))
    assert Admission(cells=400).most == most
    assert limits[-1] == (then, hard)
