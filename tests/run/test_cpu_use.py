"""Whose fault a wait for a CPU is: pure, and on this machine's own figures."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterable
from itertools import count

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.run.host.cpu_use import CpuMeter, CpuTimes, Interval, idle_ticks, interval, others_share
from grader.run.host.disturbance import DisturbanceMeter
from grader.run.host.run_delay import RunDelays
from grader.run.process.descendants import Family, descendants

MS = 1_000_000


def samples(*others_ms: float, length_ms: int = 100) -> list[Interval]:
    """Intervals one after the other, with what others had in each."""
    return [
        Interval(number * length_ms * MS, (number + 1) * length_ms * MS, int(others * MS))
        for number, others in enumerate(others_ms)
    ]


def test_what_the_student_s_own_processes_burn_is_no_disturbance() -> None:
    # Eight busy processes on two CPUs: each waits three quarters of the time.
    before, after = CpuTimes(0, 0, 0), CpuTimes(100 * MS, 200 * MS, 0)
    own = interval(before, after, cpus=2)
    assert others_share(75 * MS, [own, own]) == 0


def test_what_the_host_takes_is_a_disturbance_in_full() -> None:
    # Somebody else keeps both CPUs busy; the student gets 10 ms of 200.
    taken = interval(CpuTimes(0, 0, 0), CpuTimes(100 * MS, 10 * MS, 0), cpus=2)
    assert others_share(90 * MS, [taken]) == 90 * MS


def test_a_busy_student_is_disturbed_by_what_others_take_and_not_by_the_rest() -> None:
    # Two busy threads, two CPUs, and the probe with 5 ms: at most that was taken.
    mixed = interval(CpuTimes(0, 0, 0), CpuTimes(100 * MS, 195 * MS, 0), cpus=2)
    assert others_share(60 * MS, [mixed]) == 5 * MS


def test_cpus_that_have_nothing_to_do_take_nothing_from_anybody() -> None:
    # Four threads that are busy four tenths of the time and meet on one CPU.
    idle = interval(CpuTimes(0, 0, 0), CpuTimes(100 * MS, 160 * MS, 40 * MS), cpus=2)
    assert others_share(25 * MS, [idle]) == 0


def test_a_machine_that_stood_still_took_the_time() -> None:
    # A virtual machine was stopped for a second: neither used nor idle.
    frozen = interval(CpuTimes(0, 0, 0), CpuTimes(1000 * MS, 20 * MS, 180 * MS), cpus=2)
    assert others_share(900 * MS, [frozen]) == 900 * MS


def test_a_long_wait_is_booked_at_its_end_and_explained_by_all_of_its_time() -> None:
    # The kernel counts a wait of 300 ms when it is over; others had a CPU before, not after.
    assert others_share(300 * MS, samples(0, 100, 100, 100, 5)) == 300 * MS
    assert others_share(300 * MS, samples(100, 0, 0, 0, 0, 5)) == 5 * MS


def test_without_a_measurement_everything_is_the_host_s() -> None:
    assert others_share(7 * MS, []) == 7 * MS


@given(
    st.integers(0, 10**9),
    st.lists(st.floats(0, 400), max_size=30),
    st.floats(0, 400),
)
def test_it_is_never_more_than_the_wait_and_grows_with_what_others_took(
    waited_ns: int, others: list[float], more: float
) -> None:
    share = others_share(waited_ns, samples(*others))
    assert 0 <= share <= waited_ns
    assert others_share(waited_ns, samples(*(item + more for item in others))) >= share


class PretendedCpus(CpuMeter):
    """Two CPUs, of which the student has a share."""

    def __init__(self, student: float) -> None:
        super().__init__()
        self._student = student
        self._now_ns = 0

    @property
    def cpus(self) -> int:
        return 2

    def read(self, pids: Iterable[int]) -> CpuTimes:
        self._now_ns += 100 * MS
        return CpuTimes(self._now_ns, int(self._student * 2 * self._now_ns), 0)


@pytest.mark.parametrize(("student", "counted_ms"), [(1.0, 0), (0.0, 75), (0.95, 20)])
def test_a_wait_is_a_disturbance_only_as_far_as_others_had_the_cpus(
    student: float, counted_ms: int
) -> None:
    waits, enough = count(step=75 * MS), threading.Event()

    class PretendedDelays(RunDelays):
        def read(self, pid: int) -> dict[int, int]:
            waited_ns = next(waits)
            if waited_ns > 5 * 75 * MS:
                enough.set()
            return {pid: waited_ns}

    meter = DisturbanceMeter(lambda: (1,), PretendedCpus(student), PretendedDelays())
    meter.start()
    assert enough.wait(30)
    third = meter.stop()[3]
    # What others had in the sample before counts as well: the wait may have begun in it.
    assert third.waited_ns == pytest.approx(counted_ms * MS, abs=1000)


@pytest.mark.parametrize(("own_ms", "others_ms"), [(20, 100), (60, 100), (90, 10)])
def test_a_cell_that_is_flooded_is_no_disturbance(own_ms: int, others_ms: int) -> None:
    """The student has one of two CPUs, and somebody the other one."""
    after = CpuTimes(100 * MS, 100 * MS, 0, own_ns=own_ms * MS)
    assert interval(CpuTimes(0, 0, 0), after, cpus=2).others_ns == others_ms * MS


def test_a_process_that_takes_its_time_with_it_makes_nobody_owe_anything() -> None:
    ended = interval(CpuTimes(0, 500 * MS, 0), CpuTimes(100 * MS, 0, 0), cpus=2)
    assert ended.others_ns == 200 * MS


@pytest.mark.parametrize("cpus", [2, 4])
def test_what_is_hidden_is_not_taken_for_the_machine_s(cpus: int) -> None:
    """Two processes were there, and ended with nobody to wait for them."""
    after = CpuTimes(100 * MS, 40 * MS, 0, orphans=2)
    others_ms = interval(CpuTimes(0, 0, 0), after, cpus).others_ns / MS
    assert others_ms == max(0, cpus * 100 - 40 - 2 * 100)


def test_a_relay_of_processes_that_nobody_waits_for_is_no_disturbance() -> None:
    script = """
import os, signal, time
signal.signal(signal.SIGCHLD, signal.SIG_IGN)
while True:
    for _ in range(2):
        if os.fork() == 0:
            while time.process_time() < .05:
                pass
            os._exit(0)
    try:
        # Both are gone then.
        os.wait()
    except ChildProcessError:
        pass
"""
    meter, family = CpuMeter(), Family(os.getpid())
    with subprocess.Popen([sys.executable, "-S", "-c", script]) as relay:
        try:
            first, hidden = meter.read(family.look()), 0
            until_s = time.monotonic() + 30
            while hidden < 10 and time.monotonic() < until_s:
                time.sleep(0.1)
                hidden += meter.read(family.look()).orphans
        finally:
            relay.kill()
    # Some of what each took is known, and that each has ended.
    assert hidden >= 10
    assert meter.read(family.look()).student_ns - first.student_ns > 100 * MS


def test_idle_time_is_read_of_the_cpus_that_may_be_used() -> None:
    stat = (
        "cpu  10 0 10 300 30 0 0 0 0 0\n"
        "cpu0 5 0 5 100 10 0 0 0 0 0\n"
        "cpu1 5 0 5 200 20 0 0 0 0 0\n"
        "cpu10 5 0 5 7 7 0 0 0 0 0\n"
        "intr 5 0 0 0 0 0\n"
    )
    assert idle_ticks(stat, {0}) == 110
    assert idle_ticks(stat, {0, 1}) == 330
    with pytest.raises(IndexError):
        idle_ticks("cpu0 5\n", {0})


def test_a_process_s_time_counts_when_it_has_ended_as_well() -> None:
    burn = "import time\nwhile time.process_time() < 0.3: pass\nprint(flush=True)\ninput()"
    command = [sys.executable, "-S", "-c", burn]
    meter = CpuMeter()
    before = meter.read([])
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as child:
        assert child.stdout is not None
        child.stdout.readline()
        assert meter.read([child.pid]).student_ns - before.student_ns >= 250 * MS
        child.communicate(b"\n")
    after = meter.read([])
    assert after.student_ns - before.student_ns >= 250 * MS
    assert after.time_ns > before.time_ns
    assert after.orphans == meter.read([]).orphans == 0
    assert meter.cpus == len(os.sched_getaffinity(0))


def test_the_family_of_a_process_holds_the_children_of_its_children() -> None:
    script = (
        "import subprocess\nprint(subprocess.Popen(['sleep', '60']).pid, flush=True)\ninput()\n"
    )
    command = [sys.executable, "-S", "-c", script]
    with subprocess.Popen(
        command, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as child:
        assert child.stdout is not None
        ours = Family(os.getpid())
        assert child.pid in ours.look()
        try:
            grandchild = int(child.stdout.readline())
            assert {child.pid, grandchild} <= ours.look()
            assert Family(child.pid).look() == {grandchild} == set(descendants(child.pid))
            assert child.stdin is not None
            child.stdin.close()
            child.wait()
            assert child.pid not in ours.look()
            # Its parent has gone; whoever is known stays known.
            assert grandchild in ours.look()
        finally:
            os.kill(grandchild, 9)
            child.kill()
