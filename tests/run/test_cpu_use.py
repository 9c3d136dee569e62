"""Whose fault a wait for a CPU is: pure, and on this machine's own figures."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterable
from functools import partial
from itertools import count

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.run.host.cpu_times import CpuMeter, CpuTimes, Interval, interval, others_share
from grader.run.host.disturbance import DisturbanceMeter
from grader.run.host.run_delay import Scheduled, Waits, beyond, scheduled, uncounted
from grader.run.host.stopwatch import Stopwatch
from grader.run.process.descendants import Family
from grader.sandbox.cpu_time import idle_ticks

MS = 1_000_000


def samples(*others_ms: float, length_ms: int = 100) -> list[Interval]:
    """Intervals one after the other, with what others had in each."""
    return [
        Interval(number * length_ms * MS, (number + 1) * length_ms * MS, int(others * MS))
        for number, others in enumerate(others_ms)
    ]


@pytest.mark.parametrize(
    ("waited_ms", "wall_ms", "student_ms", "idle_ms", "others_ms"),
    [
        pytest.param(75, 100, 200, 0, 0, id="eight busy processes of the student's on two CPUs"),
        pytest.param(90, 100, 10, 0, 90, id="others keep both CPUs busy"),
        pytest.param(60, 100, 195, 0, 0, id="two busy threads of the student's, and the probe"),
        pytest.param(95, 100, 100, 0, 0, id="its children keep one CPU busy, others the other"),
        pytest.param(25, 100, 160, 40, 0, id="four threads that meet on one CPU"),
        pytest.param(900, 1000, 20, 180, 900, id="a virtual machine that stood still"),
    ],
)
def test_only_what_others_had_of_the_cpus_is_a_disturbance(
    waited_ms: int, wall_ms: int, student_ms: int, idle_ms: int, others_ms: int
) -> None:
    after = CpuTimes(wall_ms * MS, student_ms * MS, idle_ms * MS)
    measured = interval(CpuTimes(0, 0, 0), after, cpus=2)
    assert others_share(waited_ms * MS, [measured]) == others_ms * MS


def test_a_long_wait_is_booked_at_its_end_and_explained_by_all_of_its_time() -> None:
    # The kernel counts a wait of 300 ms when it is over; others had a CPU before, not after.
    assert others_share(300 * MS, samples(0, 100, 100, 100, 5)) == 300 * MS
    assert others_share(300 * MS, samples(100, 0, 0, 0, 0, 5)) == 5 * MS


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
        self.cpus = 2
        self._student = student
        self._now_ns = 0

    def read(self, pids: Iterable[int]) -> CpuTimes:
        self._now_ns += 100 * MS
        return CpuTimes(self._now_ns, int(self._student * 2 * self._now_ns), 0)


@pytest.mark.parametrize(("student", "counted_ms"), [(1.0, 0), (0.0, 75), (0.45, 20)])
def test_a_wait_is_a_disturbance_only_as_far_as_others_had_the_cpus(
    student: float, counted_ms: int
) -> None:
    waits, enough = count(step=75 * MS), threading.Event()

    def threads(pid: int) -> dict[int, Scheduled]:
        waited_ns = next(waits)
        if waited_ns > 5 * 75 * MS:
            enough.set()
        return {pid: Scheduled(0, waited_ns)}

    meter = DisturbanceMeter(lambda: (1,), PretendedCpus(student), threads)
    meter.start()
    assert enough.wait(30)
    third = meter.stop()[3]
    # What others had in the sample before counts as well: the wait may have begun in it.
    assert third.waited_ns == pytest.approx(counted_ms * MS, abs=1000)


def test_a_sample_is_of_the_time_before_it_was_read() -> None:
    noted, enough = [], threading.Event()

    def threads(pid: int) -> dict[int, Scheduled]:
        # What comes after this, while the thread that samples may be held up, is not in the sample.
        noted.append(time.time_ns())
        enough.set()
        return {pid: Scheduled(0, 0)}

    meter = DisturbanceMeter(lambda: (1,), PretendedCpus(0.0), threads)
    meter.start()
    assert enough.wait(30)
    first, *_ = meter.stop()
    assert first.time_ns <= noted[0]


def test_a_wait_for_the_kernel_is_the_machine_s_where_it_lasts() -> None:
    looks, enough = iter("DSDDDSSS"), threading.Event()

    def blocked(_: int) -> bool:
        state = next(looks, "")
        if not state:
            enough.set()
        return state == "D"

    meter = DisturbanceMeter(
        lambda: (1,), PretendedCpus(0.0), lambda pid: {pid: Scheduled(0, 0)}, blocked
    )
    meter.start()
    assert enough.wait(30)
    waited = [one.waited_ns for one in meter.stop()]
    assert [bool(ns) for ns in waited[:8]] == [state == "D" for state in "SSSDDSSS"]
    assert waited[3] >= 90 * MS


def test_a_limit_is_not_over_before_it_is_known_what_the_machine_took(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    meter = DisturbanceMeter(lambda: (), PretendedCpus(0.0))
    meter.start()
    meter.stop()
    watch, now_s = Stopwatch(meter), time.monotonic()
    # The thread that samples gets no CPU: whatever the machine took in these 4 s comes to be known
    # later. Even so it ends, after eight times as long.
    for later_s, measured_s in ((4.0, 0.5), (40.0, 5.0)):
        monkeypatch.setattr(time, "monotonic", partial(float, now_s + later_s))
        assert watch.elapsed_s == pytest.approx(later_s, abs=0.1)
        assert watch.measured_s == pytest.approx(measured_s, abs=0.1)


@pytest.mark.parametrize(("own_ms", "others_ms"), [(20, 90), (40, 75), (60, 55), (90, 25)])
def test_a_cell_that_is_flooded_is_no_disturbance(own_ms: int, others_ms: int) -> None:
    """The student has a tenth of a CPU, and the cell more than a quarter of one."""
    after = CpuTimes(100 * MS, 10 * MS, 0, own_ns=own_ms * MS)
    assert interval(CpuTimes(0, 0, 0), after, cpus=2).others_ns == others_ms * MS


def test_a_process_that_takes_its_time_with_it_adds_to_no_account() -> None:
    ended = interval(CpuTimes(0, 500 * MS, 0), CpuTimes(100 * MS, 0, 0), cpus=2)
    assert ended.others_ns == 100 * MS


@pytest.mark.parametrize("cpus", [2, 4])
def test_what_is_hidden_is_not_taken_for_the_machine_s(cpus: int) -> None:
    """Two processes were there, and ended without a parent that waited for them."""
    after = CpuTimes(100 * MS, 40 * MS, 0, orphans=2)
    others_ms = interval(CpuTimes(0, 0, 0), after, cpus).others_ns / MS
    assert others_ms == 0
    seen = CpuTimes(100 * MS, 40 * MS, 0)
    assert interval(CpuTimes(0, 0, 0), seen, cpus).others_ns == 60 * MS


def test_a_relay_of_processes_without_a_parent_s_wait_is_no_disturbance() -> None:
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
    meter, look = CpuMeter(), Family(os.getpid()).look
    with subprocess.Popen([sys.executable, "-S", "-c", script]) as relay:
        try:
            first, hidden = meter.read(look()), 0
            until_s = time.monotonic() + 30
            while hidden < 10 and time.monotonic() < until_s:
                time.sleep(0.1)
                hidden += meter.read(look()).orphans
        finally:
            relay.kill()
    # Some of what each took is known, and that each has ended.
    assert hidden >= 10
    assert meter.read(look()).student_ns - first.student_ns > 100 * MS


def test_idle_time_is_read_of_the_cpus_that_may_be_used() -> None:
    stat = (
        "cpu  10 0 10 300 30 0 0 0 0 0\n"
        "cpu0 5 0 5 100 10 0 0 0 0 0\n"
        "cpu1 5 0 5 200 20 0 7 0 0 0\n"
        "cpu10 5 0 5 7 7 0 0 0 0 0\n"
        "intr 5 0 0 0 0 0\n"
    )
    assert idle_ticks(stat, {0}) == 110
    assert idle_ticks(stat, {0, 1}) == 337
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


BURN = """\
import os, sys, time
os.sched_setaffinity(0, {int(sys.argv[1])})
while time.process_time() < 0.2: pass
print(flush=True)
input()
"""


def test_threads_that_wait_at_once_lose_the_time_once() -> None:
    samples: list[tuple[int, int, int]] = []
    for number in range(1, 21):
        # In each of them the wait of another thread ends, which began 300 ms before.
        waited_ns = uncounted(300 * MS, number * 100 * MS, samples)
        samples.append(((number - 1) * 100 * MS, number * 100 * MS, waited_ns))
    assert sum(waited for _, _, waited in samples) <= (20 * 100 + 300) * MS
    # One thread waits again and again, never twice at once.
    assert uncounted(
        40 * MS, 300 * MS, [(0, 100 * MS, 40 * MS), (100 * MS, 200 * MS, 40 * MS)]
    ) == (40 * MS)


@pytest.mark.parametrize(("hogs", "last_ms"), [(8, 20), (2, 90)])
def test_more_hogs_than_cpus_explain_no_delay_once_they_have_started(
    hogs: int, last_ms: int
) -> None:
    """A node waits for 20 ms of 100, and what it has started for 90; others keep the CPUs busy."""
    waits, found = Waits(cpus=2), []
    for second in range(100):
        threads = {0: Scheduled(second * 30 * MS, second * 200 * MS)}
        for number in range(1, hogs + 1):
            threads[number] = Scheduled(second * 100 * MS, second * 900 * MS)
        found.append(waits.longest_ns(second * 1000 * MS, threads) // (10 * MS))
    assert found[1] == 90
    assert found[-1] == last_ms


@pytest.mark.parametrize("nodes", [3, 4, 12])
def test_nodes_that_start_at_once_on_a_loaded_machine_wait_for_it(nodes: int) -> None:
    """Each had 0.6 s of CPU time so far; one that goes on to compute has soon had too much."""
    waits = Waits(cpus=2)
    assert waits.longest_ns(0, {}) == 0
    starting = dict.fromkeys(range(nodes), Scheduled(600 * MS, 9300 * MS))
    assert waits.longest_ns(9900 * MS, starting) == 9300 * MS
    spinning = dict.fromkeys(range(nodes), Scheduled(1100 * MS, 9600 * MS))
    assert waits.longest_ns(10700 * MS, spinning) == 0


@pytest.mark.parametrize(
    ("late_ms", "waited_ms", "length_ms", "more_ms"),
    [
        pytest.param(400, 400, 420, 20, id="the machine stood still"),
        pytest.param(30, 40, 100, 30, id="one after the other"),
        pytest.param(280, 300, 100, 0, id="a long wait is booked at its end"),
    ],
)
def test_what_holds_up_student_and_probe_at_once_is_one_delay(
    late_ms: int, waited_ms: int, length_ms: int, more_ms: int
) -> None:
    assert beyond(late_ms, waited_ms, length_ms) == more_ms


def test_threads_that_share_one_cpu_wait_for_it() -> None:
    command = [sys.executable, "-S", "-c", BURN, str(min(os.sched_getaffinity(0)))]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    both = [subprocess.Popen(command, **pipes) for _ in range(2)]
    try:
        for process in both:
            assert process.stdout is not None and process.stdout.readline()
        # Each had 0.2 s of the same CPU: one of them waited for most of the other's.
        assert max(scheduled(process.pid)[process.pid].waited_ns for process in both) > 50 * MS
    finally:
        for process in both:
            process.communicate()
    assert scheduled(both[0].pid) == {}
