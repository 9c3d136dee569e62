"""What a cell makes of a zygote that does not fork; a socket stands for the zygote."""

from __future__ import annotations

import os
import select
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from grader.run import forked
from grader.run.descendants import descendants, send
from grader.run.enclosure import EnclosedProcess, Enclosure
from grader.run.forked import ForkedProcess, NotForked
from grader.run.guard import Guard
from grader.sandbox.limits import Limits
from grader.sandbox.sandbox import Sandbox
from grader.sandbox.trial import try_sandbox

_ROOM, _DESCRIPTORS = 65_536, 8
_LIMIT_S = 10.0


@pytest.fixture
def enclosure(tmp_path: Path) -> Enclosure:
    found = try_sandbox()
    if found.problem:
        pytest.skip(f"no sandbox on this machine: {found.problem}; {found.remedy}")
    sandbox = Sandbox(tmp_path / "cache")
    return Enclosure(
        arguments=(
            *("--unshare-user", "--unshare-pid", "--die-with-parent"),
            *("--ro-bind", "/", "/", "--proc", "/proc", "--dev", "/dev"),
        ),
        filter=str(sandbox.filter_file),
        guard=str(sandbox.guard_file),
        unheard=str(sandbox.unheard_file),
        calls=sandbox.guarded_calls,
        limits=Limits(),
        folders={},
    )


@pytest.fixture
def zygote() -> Iterator[tuple[socket.socket, socket.socket]]:
    """The nursery's end, and that of the zygote."""
    nursery, zygote = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with nursery, zygote:
        for one in (nursery, zygote):
            one.settimeout(_LIMIT_S)
        yield nursery, zygote


def test_a_sandbox_that_is_set_up_looks_like_no_attempt_to_end_what_runs_in_it(
    enclosure: Enclosure,
) -> None:
    programs = [Path(file).read_bytes() for file in (enclosure.guard, enclosure.unheard)]
    guard = Guard(programs[0], enclosure.calls, programs[1])
    started = guard.start(lambda: EnclosedProcess(enclosure, ("/usr/bin/cat",), {}, (), held=True))
    assert started.stdin is not None
    assert started.stdout is not None
    assert started.stderr is not None
    with started.stdin, started.stdout, started.stderr:
        os.write(started.stdin.fileno(), b".")
        assert started.stdout.read(1) == b"."
        assert started.init is not None
        send(signal.SIGKILL, descendants(started.init))
        started.wait(_LIMIT_S)
    assert started.exit_code == -signal.SIGKILL
    assert guard.can_have_ended(()) is guard.can_have_ended({started.init}) is True
    assert not guard.can_have_ended({started.pid, started.init})
    guard.close()


def fork(enclosure: Enclosure, zygote: socket.socket) -> None:
    """Ask for a fork, as a cell does."""
    tracer = os.pipe()
    try:
        ForkedProcess(enclosure, zygote.fileno(), {}, tracer, os.close)
    finally:
        for descriptor in tracer:
            os.close(descriptor)


def answered(zygote: socket.socket, answer: Callable[[list[int]], None]) -> threading.Thread:
    def serve() -> None:
        _, descriptors, _, _ = socket.recv_fds(zygote, _ROOM, _DESCRIPTORS)
        answer(descriptors)
        for descriptor in descriptors:
            os.close(descriptor)

    thread = threading.Thread(target=serve)
    thread.start()
    return thread


def test_a_fork_that_ends_is_noticed_at_once_and_its_zygote_may_fork_again(
    enclosure: Enclosure, zygote: tuple[socket.socket, socket.socket]
) -> None:
    nursery, its_own = zygote
    thread = answered(its_own, lambda _descriptors: None)
    with pytest.raises(NotForked, match="the zygote's fork has ended"):
        fork(enclosure, nursery)
    thread.join()
    its_own.send(b"0.1")
    assert nursery.recv(_ROOM) == b"0.1"


@pytest.fixture
def unanswered(
    enclosure: Enclosure,
    zygote: tuple[socket.socket, socket.socket],
    monkeypatch: pytest.MonkeyPatch,
) -> tuple[socket.socket, socket.socket]:
    """One that was asked for a fork, and did not answer in time."""
    nursery, _ = zygote
    monkeypatch.setattr(forked, "_LIMIT_S", 0.5)
    with pytest.raises(NotForked, match="timed out"):
        fork(enclosure, nursery)
    return zygote


def test_a_zygote_that_does_not_answer_is_asked_no_more(
    enclosure: Enclosure, unanswered: tuple[socket.socket, socket.socket]
) -> None:
    nursery, its_own = unanswered
    # As every cell and the nursery itself see it, and the zygote when it goes on.
    assert nursery.recv(_ROOM) == b""
    assert its_own.recv(_ROOM)
    assert its_own.recv(_ROOM) == b""
    with pytest.raises(NotForked):
        fork(enclosure, nursery)


def test_a_fork_that_was_not_waited_for_runs_nothing(
    unanswered: tuple[socket.socket, socket.socket],
) -> None:
    _, its_own = unanswered
    _, (*_, reply), _, _ = socket.recv_fds(its_own, _ROOM, _DESCRIPTORS)
    with socket.socket(fileno=reply) as told:
        assert select.select([told], [], [], _LIMIT_S)[0]
        assert told.recv(1) == b""
