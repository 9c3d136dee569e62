"""A student's process that a zygote forks into its sandbox.

bubblewrap makes the sandbox as for every student's process, and holds it with a program that
only waits. The zygote's fork joins the sandbox's namespaces, keeps the same rights and limits,
and its end is told as bubblewrap would tell it.
"""

from __future__ import annotations

import array
import contextlib
import json
import os
import select
import signal
import socket
import struct
from collections.abc import Callable, Mapping

from grader.run.descendants import descendants
from grader.run.enclosure import HOME, EnclosedProcess, Enclosure

_HOLDER = ("/usr/bin/cat",)
"""It answers when the sandbox stands, and ends with its standard input."""
_HELD = b"."
_LIMIT_S = 5.0
"""Then it is started anew."""
_REPLY_BYTES = 64
# As the zygote says it, which sees nothing of this module.
_FORKED = b"forked"
_GO = b"+"
_CREDENTIALS = struct.Struct("=iII")
_DESCRIPTOR_BYTES = array.array("i").itemsize


class NotForked(Exception):
    """The zygote did not fork; nothing of the student's has run."""


class ForkedProcess(EnclosedProcess):
    """A process of a zygote in a sandbox, with the surface of one that was started in it."""

    def __init__(
        self,
        enclosure: Enclosure,
        zygote: int,
        environment: Mapping[str, str],
        pipes: tuple[int, int],
        watch: Callable[[int], None],
    ) -> None:
        """Start it.

        Args:
            enclosure: The sandbox.
            zygote: Descriptor of its socket.
            environment: Variables of the process.
            pipes: The tracer's: what it writes to, and what it waits for. They get other numbers,
                which the zygote writes into the variables.
            watch: Gets the descriptor through which the kernel asks about its system calls.

        Raises:
            NotForked: The sandbox does not stand, or the zygote is gone.
            OSError: Not even bubblewrap can be executed.
        """
        self._told_group: int | None = None
        self._told_code: int | None = None
        try:
            self._reply, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        except OSError as error:
            raise NotForked(str(error)) from error
        super().__init__(enclosure, _HOLDER, {"PATH": "/usr/bin:/bin"}, (), held=True)
        given = [theirs.detach()]
        readable = []
        try:
            self._reply.setsockopt(socket.SOL_SOCKET, socket.SO_PASSCRED, 1)
            self._reply.settimeout(_LIMIT_S)
            try:
                for _ in range(2):
                    read, write = os.pipe()
                    readable.append(open(read, "rb", 0))  # noqa: PTH123, SIM115
                    given.append(write)
                reply, *streams = given
                self._ask(enclosure, zygote, environment, (*streams, *pipes, reply))
            finally:
                # Of a reply that is open here as well nobody would see the end.
                for descriptor in given:
                    os.close(descriptor)
            self._hear_of_fork(watch)
        except (OSError, NotForked) as error:
            self._tear_down()
            for stream in readable:
                stream.close()
            if isinstance(error, TimeoutError):
                _dismiss(zygote)
            raise NotForked(str(error)) from error
        self._reply.setblocking(False)
        assert self.stdout is not None
        assert self.stderr is not None
        self.stdout.close()
        self.stderr.close()
        self.stdout, self.stderr = readable

    @property
    def group(self) -> int | None:
        """Process group of the student's process."""
        return self._told_group

    @property
    def was_set_up(self) -> bool:
        """Whether the student's program was started."""
        return True

    @property
    def exit_code(self) -> int | None:
        """As in :mod:`subprocess`: negative for the signal that ended it."""
        return self._as_signal(self._told_code)

    def poll(self) -> int | None:
        """Whether it has ended; see :mod:`subprocess`."""
        if self._told_code is None:
            self._hear_of_end()
        if self._told_code is None:
            return None
        assert self.stdin is not None
        if not self.stdin.closed:
            self.stdin.close()
        return super().poll()

    def _ask(
        self,
        enclosure: Enclosure,
        zygote: int,
        environment: Mapping[str, str],
        given: tuple[int, ...],
    ) -> None:
        """Ask for a fork.

        Args:
            enclosure: The sandbox.
            zygote: Descriptor of its socket.
            environment: Variables of the process.
            given: Its standard output and error, the tracer's pipes, and where it replies.
        """
        request = {
            # As bubblewrap sets it with the folder.
            "environment": {**environment, "PWD": HOME},
            "folder": HOME,
            "limits": list(enclosure.limits.rlimits().items()),
        }
        stdout, stderr, *others = given
        opened = [os.pidfd_open(self._holder())]
        try:
            for file in (enclosure.guard, enclosure.filter):
                opened.append(os.open(file, os.O_RDONLY))
            holder, guard, rules = opened
            with socket.socket(fileno=os.dup(zygote)) as asked:
                socket.send_fds(
                    asked,
                    [json.dumps(request).encode()],
                    [holder, stdout, stderr, guard, rules, *others],
                    socket.MSG_DONTWAIT,
                )
        finally:
            for descriptor in opened:
                os.close(descriptor)

    def _holder(self) -> int:
        """Process id of what holds the sandbox, when that stands."""
        assert self.stdin is not None
        assert self.stdout is not None
        os.write(self.stdin.fileno(), _HELD)
        stands = select.select([self.stdout], [], [], _LIMIT_S)[0] and self.stdout.read(1) == _HELD
        init = self.init
        holders = tuple(descendants(init)) if stands and init is not None else ()
        if len(holders) != 1:
            raise NotForked("the sandbox does not stand")
        return holders[0]

    def _hear_of_fork(self, watch: Callable[[int], None]) -> None:
        room = socket.CMSG_SPACE(_CREDENTIALS.size) + socket.CMSG_SPACE(_DESCRIPTOR_BYTES)
        text, told, _, _ = self._reply.recvmsg(_REPLY_BYTES, room)
        for _, kind, data in told:
            if kind == socket.SCM_RIGHTS:
                watch(array.array("i", data[:_DESCRIPTOR_BYTES])[0])
            elif text == _FORKED:
                self._told_group, _, _ = _CREDENTIALS.unpack(data[: _CREDENTIALS.size])
        if self._told_group is None:
            raise NotForked("the zygote's fork has ended")
        self._reply.send(_GO)

    def _hear_of_end(self) -> None:
        try:
            text = self._reply.recv(_REPLY_BYTES)
        except BlockingIOError:
            return
        except OSError:
            text = b""
        # Without a word it was killed, by the student or by us.
        self._told_code = int(text) if text else -signal.SIGKILL
        self._reply.close()

    def _tear_down(self) -> None:
        """Let nothing join the sandbox any more."""
        self._reply.close()
        with contextlib.suppress(OSError):
            if self.init is not None:
                os.kill(self.init, signal.SIGKILL)
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGKILL)
        for stream in (self.stdin, self.stdout, self.stderr):
            if stream is not None:
                stream.close()
        self.wait()


def _dismiss(zygote: int) -> None:
    """Let nobody wait again for one that does not answer; its nursery sees that it has ended."""
    with socket.socket(fileno=os.dup(zygote)) as asked, contextlib.suppress(OSError):
        asked.shutdown(socket.SHUT_RDWR)
