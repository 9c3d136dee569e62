"""How long threads had to wait for a CPU is read from the kernel, and nothing stays open."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from grader.run.host import run_delay
from grader.run.host.run_delay import RunDelays

BURN = """\
import os, sys, time
os.sched_setaffinity(0, {int(sys.argv[1])})
while time.process_time() < 0.2: pass
print(flush=True)
input()
"""


def open_files() -> int:
    return len(os.listdir("/proc/self/fd"))  # noqa: PTH208


def test_threads_that_share_one_cpu_wait_for_it() -> None:
    cpu = str(min(os.sched_getaffinity(0)))
    both = [
        subprocess.Popen(
            [sys.executable, "-S", "-c", BURN, cpu],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        for _ in range(2)
    ]
    delays = RunDelays()
    try:
        for process in both:
            assert process.stdout is not None and process.stdout.readline()
        # Each had 0.2 s of the same CPU: one of them waited for most of the other's.
        waited = [delays.read(process.pid)[process.pid] for process in both]
        assert max(waited) > 50_000_000
        again = [delays.read(process.pid)[process.pid] for process in both]
        assert all(later >= earlier for earlier, later in zip(waited, again, strict=True))
    finally:
        for process in both:
            process.communicate()
    assert delays.read(both[0].pid) == {}


@pytest.mark.parametrize("most", [0, 100])
def test_a_file_is_open_only_while_its_thread_lives(
    monkeypatch: pytest.MonkeyPatch, most: int
) -> None:
    monkeypatch.setattr(run_delay, "_MOST_OPEN", most)
    before = open_files()
    delays, end = RunDelays(), threading.Event()
    threads = [threading.Thread(target=end.wait) for _ in range(3)]
    for thread in threads:
        thread.start()
    known = delays.read(os.getpid())
    assert {thread.native_id for thread in threads} <= known.keys()
    assert open_files() - before == (len(known) if most else 0)
    end.set()
    for thread in threads:
        thread.join()
    while any(Path(f"/proc/self/task/{thread.native_id}").exists() for thread in threads):
        pass
    left = delays.read(os.getpid())
    assert not {thread.native_id for thread in threads} & left.keys()
    assert open_files() - before == (len(left) if most else 0)
    delays.forget(but=[os.getpid()])
    assert open_files() - before == (len(left) if most else 0)
    delays.forget()
    assert open_files() == before


def test_of_a_process_that_is_not_there_nothing_is_known() -> None:
    assert RunDelays().read(2**22 + 1) == {}
