"""Waiting for descriptors, of which a class on a large machine has more than 1024."""

from __future__ import annotations

import fcntl
import io
import os
import resource
from collections.abc import Iterator

import pytest

from grader.run.cell.prefork_server import _TOLD, ForkedCell
from grader.run.host.readable import readable


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    """A pipe whose read end has a number that select(2) does not bear."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != resource.RLIM_INFINITY and soft <= 2000:
        if hard != resource.RLIM_INFINITY and hard <= 2000:
            pytest.skip("no process may have so many descriptors here")
        resource.setrlimit(resource.RLIMIT_NOFILE, (2001, hard))
    low, write = os.pipe()
    read = fcntl.fcntl(low, fcntl.F_DUPFD_CLOEXEC, 2000)
    os.close(low)
    yield read, write
    os.close(write)
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_what_can_be_read_and_what_cannot(pipe: tuple[int, int]) -> None:
    read, write = pipe
    assert readable((read,), 0) == set()
    os.write(write, b".")
    assert readable((read,)) == {read}
    os.close(read)


def test_an_end_can_be_read() -> None:
    read, write = os.pipe()
    os.close(write)
    assert readable((read,)) == {read}
    os.close(read)


def test_a_cell_of_many_is_waited_for(pipe: tuple[int, int]) -> None:
    read, write = pipe
    os.write(write, _TOLD.pack(1000, 0.0) + _TOLD.pack(3, 0.5))
    cell = ForkedCell(io.StringIO(), io.StringIO(), read, lambda _pid: None)
    assert cell.wait(10.0) == 3
    assert cell.cpu_s == 0.5
