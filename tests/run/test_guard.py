"""A guard in this process: the calls that it is asked about, and its words for them."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from collections.abc import Iterator

import pytest

from grader.run.process.guard import Guard
from grader.sandbox.seccomp import can_end, guard_filter, guarded_calls, violation_of

pytest.importorskip("pyseccomp")
CALLS = guarded_calls()
INIT, OTHER = 1, 2


@pytest.fixture
def guard() -> Iterator[Guard]:
    guard = Guard(guard_filter(), CALLS)
    yield guard
    guard.close()


def run(guard: Guard, source: str) -> str:
    command = [sys.executable, "-S", "-c", source]
    return guard.start(
        lambda: subprocess.run(command, capture_output=True, text=True, check=True).stdout
    )


@pytest.mark.parametrize(
    ("name", "arguments", "said"),
    [
        ("kill", (INIT, 9), "sent SIGKILL to the process that holds their sandbox"),
        ("tgkill", (INIT, 1, 15), "sent SIGTERM to the process that holds their sandbox"),
        ("kill", (INIT, 99), "sent signal 99 to the process that holds their sandbox"),
        ("ptrace", (16, INIT), "called `ptrace` on the process that holds their sandbox"),
        ("ptrace", (16, OTHER), None),
        ("process_vm_readv", (INIT,), "called `process_vm_readv` on the process that holds their"),
        ("reboot", (0,), "called `reboot`"),
        # Their first argument is a clock or a descriptor, which may have the number 1 as well.
        ("timer_create", (1,), None),
        ("fcntl", (1, 10), None),
        ("pidfd_send_signal", (1, 9), None),
    ],
)
def test_a_call_is_put_into_words(name: str, arguments: tuple[int, ...], said: str | None) -> None:
    told = violation_of(name, (*arguments, *(0,) * (6 - len(arguments))))
    assert told == said if said is None else told is not None and told.startswith(said)


@pytest.mark.parametrize("number", [19, 20, 21, 22])
def test_a_process_that_may_stop_another_may_have_ended_it(number: int) -> None:
    assert can_end("kill", (OTHER, number, 0, 0, 0, 0))
    assert not can_end("kill", (OTHER, 15, 0, 0, 0, 0))


def test_a_process_id_counts_by_the_bits_that_the_kernel_looks_at() -> None:
    assert violation_of("kill", ((1 << 32) + INIT, 9, 0, 0, 0, 0)) is not None


def test_what_a_process_asks_for_is_refused_and_noted(guard: Guard) -> None:
    source = (
        "import ctypes\n"
        "libc = ctypes.CDLL(None, use_errno=True)\n"
        f"print(libc.syscall({CALLS['bpf']}, 0, 0, 0), ctypes.get_errno())\n"
        "import os\n"
        "try:\n    os.kill(1, 15)\nexcept PermissionError:\n    print('refused')"
    )
    assert run(guard, source).split() == ["-1", "1", "refused"]
    assert guard.violations == (
        "called `bpf`",
        "sent SIGTERM to the process that holds their sandbox",
    )


def test_a_process_may_do_what_it_likes_with_its_own(guard: Guard) -> None:
    source = (
        "import os, signal, subprocess\n"
        "signal.signal(signal.SIGUSR1, lambda *_: print('heard'))\n"
        "os.kill(os.getpid(), signal.SIGUSR1)\n"
        "signal.raise_signal(signal.SIGUSR1)\n"
        "child = subprocess.Popen(['sleep', '60'])\n"
        "child.kill()\n"
        "print(child.wait())\n"
    )
    assert run(guard, source).split() == ["heard", "heard", "-9"]
    assert guard.violations == ()


def test_who_stands_guard_is_not_under_it(guard: Guard) -> None:
    run(guard, "")
    # No such command: it has no effect.
    assert ctypes.CDLL(None).syscall(CALLS["bpf"], -1, 0, 0) == -1
    assert guard.violations == ()


@pytest.mark.parametrize(
    ("source", "told"),
    [
        ("import os; os.kill(os.getpid(), 9)", True),
        ("import signal; signal.raise_signal(signal.SIGKILL)", True),
        ("import os, signal; signal.pidfd_send_signal(os.pidfd_open(os.getpid()), 9)", True),
        ("import os; os._exit(137)", True),
        (
            "import resource; resource.setrlimit(resource.RLIMIT_CPU, (1, 1))\nwhile True: pass",
            True,
        ),
        ("import os; os.kill(os.getpid(), 15)", False),
        ("import fcntl; fcntl.fcntl(0, fcntl.F_GETFD)", False),
    ],
)
def test_every_way_to_kill_a_process_from_within_is_noted(
    guard: Guard, source: str, told: bool
) -> None:
    command = [sys.executable, "-S", "-c", source]
    ended = guard.start(lambda: subprocess.run(command, check=False))
    assert (ended.returncode in (-9, 137)) is told
    assert guard.can_have_ended(()) is told


def test_a_terminal_of_its_own_is_a_way_to_stop_a_process(guard: Guard) -> None:
    assert run(guard, "import os; print(len(os.openpty()))").split() == ["2"]
    assert guard.can_have_ended(())
    assert guard.violations == ()


def test_a_program_may_use_any_timer(guard: Guard) -> None:
    source = (
        "import ctypes\n"
        "timer = ctypes.c_int()\n"
        f"create = ctypes.CDLL(None).syscall, {CALLS['timer_create']}\n"
        "print(*(create[0](create[1], clock, None, ctypes.byref(timer)) for clock in (0, 1)))"
    )
    assert run(guard, source).split() == ["0", "0"]
    assert guard.violations == ()


def test_a_signal_from_outside_is_none_of_theirs(guard: Guard) -> None:
    started = guard.start(lambda: subprocess.Popen(["sleep", "60"]))
    started.kill()
    assert started.wait() == -9
    assert not guard.can_have_ended(())
