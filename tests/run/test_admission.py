"""Cells are admitted within bounds, starts are spread, and "alone" means alone."""

from __future__ import annotations

import resource
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from grader.machine import load
from grader.machine.load import Load, cpu_count
from grader.run.admission import Admission

LIMIT_S = 10.0


class Visitor(threading.Thread):
    """Takes a place, says so, and keeps it until the test lets it go."""

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


@pytest.mark.parametrize(("threads", "memory"), [(100.0, 1.0), (0.0, 0.05)])
def test_a_machine_without_cpu_or_memory_to_spare_takes_one_cell_for_each_cpu(
    threads: float, memory: float
) -> None:
    load = Busy(threads, memory)
    admission = Admission(starts=100, load=load)
    inside = [Visitor(admission) for _ in range(cpu_count())]
    assert all(visitor.is_inside() for visitor in inside)
    one_more = Visitor(admission)
    assert not one_more.inside.wait(0.2)
    load.threads, load.memory = 0.0, 0.5
    assert one_more.is_inside()
    for visitor in (*inside, one_more):
        visitor.go()


def test_the_free_memory_is_a_share() -> None:
    assert 0.0 < Load().free_memory() < 1.0


@pytest.mark.parametrize(
    ("group", "limit", "taken", "spare"),
    [
        ("0::/", "memory.max", "memory.current", "inactive_file"),
        ("0::/machine/box", "memory.max", "memory.current", "inactive_file"),
        (
            "0::/\n4:cpu,memory:/box",
            "memory/memory.limit_in_bytes",
            "memory/memory.usage_in_bytes",
            "total_inactive_file",
        ),
    ],
)
def test_a_container_may_have_less_memory_than_the_machine(
    group: str,
    limit: str,
    taken: str,
    spare: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(load, "_MEMINFO", tmp_path / "meminfo")
    monkeypatch.setattr(load, "_GROUPS", tmp_path / "groups")
    monkeypatch.setattr(load, "_GROUP_FOLDERS", tmp_path)
    (tmp_path / "meminfo").write_text("MemTotal: 1000000 kB\nMemAvailable: 900000 kB\n")
    (tmp_path / "groups").write_text(group)
    (tmp_path / limit).parent.mkdir(exist_ok=True)
    (tmp_path / limit).with_name("memory.stat").write_text(f"anon 1\n{spare} 20000\n")
    (tmp_path / taken).write_text("110000\n")
    (tmp_path / limit).write_text("100000\n")
    assert Load().free_memory() == pytest.approx(0.1)
    # As much as there is, or any amount.
    for unlimited in ("max", str(2**63 - 4096)):
        (tmp_path / limit).write_text(f"{unlimited}\n")
        assert Load().free_memory() == pytest.approx(0.9)


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
    ("soft", "hard", "then"),
    [
        (1024, 1_048_576, 8192),
        (1024, 1024, 1024),
        (1024, resource.RLIM_INFINITY, 8192),
        (resource.RLIM_INFINITY, resource.RLIM_INFINITY, resource.RLIM_INFINITY),
    ],
)
def test_a_class_gets_as_many_open_files_as_the_shell_allows(
    soft: int, hard: int, then: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    limits = [(soft, hard)]
    monkeypatch.setattr(resource, "getrlimit", lambda _: limits[-1])
    monkeypatch.setattr(resource, "setrlimit", lambda _, pair: limits.append(pair))
    Admission()
    assert limits[-1] == (then, hard)
