"""SandboxLimits as an author writes them, and as the sandbox's commands get them."""

from __future__ import annotations

import dataclasses
import os
import resource
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from pydantic import ValidationError

from grader.assignment.limits import BuildLimitOptions, LimitOptions
from grader.sandbox.limits import BUILD
from grader.sandbox.memory import hidden_bytes, memory_bytes
from grader.sandbox.usage import files_in_flight, folder_usage, open_files, usage_of


def test_an_author_s_limits_reach_the_command_in_front_of_the_program() -> None:
    limits = LimitOptions.model_validate(
        {"memory": "512 MiB", "processes": 40, "cpu_time": "2 min", "file_size": "1 MiB"}
    ).limits()
    assert limits.prlimit()[1:] == [
        "--as=4294967296",
        "--data=536870912",
        "--nproc=40",
        f"--nofile={min(1024, resource.getrlimit(resource.RLIMIT_NOFILE)[0] // 4)}",
        "--fsize=1048576",
        "--cpu=130",
        "--sigpending=1024",
        "--core=0",
    ]


def test_an_author_s_limits_of_the_build_reach_it() -> None:
    limits = BuildLimitOptions.model_validate({"memory": "1 GiB", "disk": "64 MiB", "files": 500})
    assert limits.limits() == dataclasses.replace(
        BUILD, memory_bytes=2**30, disk_bytes=64 * 2**20, files=500
    )
    assert BuildLimitOptions().limits() == BUILD


@pytest.mark.parametrize(
    ("written", "problem"),
    [
        ({"memory": "1 s"}, "is a unit of time, but a size is needed here"),
        ({"memory": 5}, "has no unit"),
        ({"processes": 2}, "greater than or equal to 16"),
        ({"memroy": "1 GiB"}, "memroy"),
    ],
)
def test_a_wrong_limit_is_refused_with_its_reason(written: object, problem: str) -> None:
    with pytest.raises(ValidationError, match=problem):
        LimitOptions.model_validate(written)


def test_what_a_program_uses_is_measured(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "b").write_bytes(bytes(range(256)) * 4096)
    (tmp_path / "link").symlink_to("/")
    size, files = folder_usage([tmp_path], 2**30, 100)
    assert files == 3
    assert 2**20 <= size < 2**21
    assert folder_usage([tmp_path], 2**30, 0)[1] >= 1
    assert memory_bytes([], 0) == 0
    assert usage_of([2**30]) == []


HOARD = """\
import mmap, sys
hoard = mmap.mmap(-1, 2**25)
hoard.write(b"x" * 2**25)
print(flush=True)
sys.stdin.readline()
hoard.madvise(mmap.MADV_DONTNEED)
print(flush=True)
sys.stdin.readline()
"""


def test_shared_memory_counts_although_it_is_resident_nowhere() -> None:
    command = [sys.executable, "-S", "-c", HOARD]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0
    ) as child:
        assert child.stdin is not None and child.stdout is not None
        child.stdout.read(1)
        assert hidden_bytes(usage_of([child.pid])) == 0
        child.stdin.write(b"\n")
        child.stdout.read(1)
        assert hidden_bytes(usage_of([child.pid])) == 2**25
        assert hidden_bytes(usage_of([child.pid]), room=2**25 - 1) == 2**25
        assert hidden_bytes(usage_of([child.pid]), room=2**50) == 0
        child.stdin.write(b"\n")
    assert memory_bytes([], 0, 2**25) == 2**25


def test_open_files_are_counted() -> None:
    (own,) = (usage for usage in usage_of([os.getpid()]) if usage.pid == os.getpid())
    before = open_files([own])
    ends = os.pipe()
    assert open_files([own]) == before + 2
    for end in ends:
        os.close(end)


def test_usage_counts_a_process_and_what_it_started() -> None:
    with subprocess.Popen(["cat"], stdin=subprocess.PIPE, start_new_session=True) as child:
        below = {usage.pid: usage for usage in usage_of([os.getpid()])}
        own = below[os.getpid()]
        assert own.parent == os.getppid()
        assert own.session == os.getsid(0)
        assert own.threads == len(os.listdir("/proc/self/task"))  # noqa: PTH208
        assert own.taken.own > 0
        assert below[child.pid].parent == os.getpid()
        assert below[child.pid].session == child.pid
        quick, shared_once = memory_bytes([own], 2**60), memory_bytes([own], 0)
        assert 2**20 < shared_once <= 1.1 * quick


def test_descriptors_in_flight_are_counted_although_others_are_closed_meanwhile(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    gone, listed = "1000000", os.listdir
    monkeypatch.setattr(os, "listdir", lambda path: [gone, *listed(path)])
    ours = [usage for usage in usage_of([os.getpid()]) if usage.pid == os.getpid()]
    here, there = socket.socketpair()
    with here, there:
        before = files_in_flight(ours)
        socket.send_fds(here, [b"."], [0, 0, 0])
        assert files_in_flight(ours) == before + 3
