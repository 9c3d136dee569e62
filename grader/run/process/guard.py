"""Sees system calls of the student's processes that a sandbox refuses, and says what they were.

The kernel asks the cell's process before it goes on with such a call (seccomp_unotify(2)). The
filter that makes it ask belongs to a thread, and to all that is started from it: so the
student's sandboxes are started from one thread, and the cell itself is not under it.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import fcntl
import os
import select
import struct
import threading
from collections.abc import Callable, Collection, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from grader.sandbox.seccomp import COUNTED, MOST_COUNTED, can_end, violation_of

# linux/seccomp.h
_SET_MODE_FILTER, _NEW_LISTENER = 1, 1 << 3
_NOTIF_RECV, _NOTIF_SEND = 0xC050_2100, 0xC018_2101
_CONTINUE = 1
# linux/prctl.h
_PR_SET_NO_NEW_PRIVS = 38
_INSTRUCTION_BYTES = 8
# id, process, flags, number, architecture, instruction, six arguments
_ASKED = struct.Struct("=QIIiIQ6Q")
# id, value, negative error, flags
_ANSWER = struct.Struct("=QqiI")

_Started = TypeVar("_Started")


class Guard:
    """Starts the student's sandboxes, and refuses the calls that the kernel asks about."""

    def __init__(self, program: bytes, calls: Mapping[str, int]) -> None:
        """Begin to listen; an OSError where a container around rosgrade listens already."""
        self._names = {number: name for name, number in calls.items()}
        self._starter = ThreadPoolExecutor(1, "starter")
        self._listener = self._starter.submit(_install, program, calls["seccomp"]).result()
        self._ending: set[int] = set()
        self._violations: list[str] = []
        self._counted = 0
        self._wake_read, self._wake_write = os.pipe()
        self._thread = threading.Thread(target=self._listen, name="guard", daemon=True)
        self._thread.start()

    def start(self, start: Callable[[], _Started]) -> _Started:
        """Start something under guard."""
        return self._starter.submit(start).result()

    def can_have_ended(self, sandboxes: Collection[int | None]) -> bool:
        """Whether the student's processes may have killed or stopped one of them themselves."""
        return bool(self._ending.difference(sandboxes))

    @property
    def violations(self) -> tuple[str, ...]:
        """Forbidden calls of the student's processes so far, as texts."""
        return tuple(self._violations)

    def close(self) -> None:
        """End; call it when nothing that was started lives any more."""
        os.close(self._wake_write)
        self._thread.join()
        self._starter.shutdown()
        os.close(self._wake_read)
        os.close(self._listener)

    def _listen(self) -> None:
        poll = select.poll()
        poll.register(self._wake_read, 0)
        poll.register(self._listener, select.POLLIN)
        while True:
            for descriptor, events in poll.poll():
                if descriptor == self._wake_read:
                    return
                if events & select.POLLIN:
                    # The process may have been killed meanwhile.
                    with contextlib.suppress(OSError):
                        self._answer(descriptor)
                else:
                    # No process under the filter is left.
                    poll.unregister(descriptor)

    def _answer(self, listener: int) -> None:
        asked = bytearray(_ASKED.size)
        fcntl.ioctl(listener, _NOTIF_RECV, asked, True)
        number, process, _flags, call, _architecture, _place, *arguments = _ASKED.unpack(asked)
        name = self._names.get(call, f"system call {call}")
        violation = violation_of(name, arguments)
        self._counted += name in COUNTED
        if name in COUNTED and self._counted <= MOST_COUNTED:
            answer = (0, _CONTINUE)
        elif violation is None and can_end(name, arguments):
            self._ending.add(process)
            answer = (0, _CONTINUE)
        else:
            if violation is not None and violation not in self._violations:
                self._violations.append(violation)
            answer = (-errno.EPERM, 0)
        fcntl.ioctl(listener, _NOTIF_SEND, _ANSWER.pack(number, 0, *answer))


def _install(program: bytes, call: int) -> int:
    """Put this thread under a filter; return the descriptor through which the kernel asks."""
    libc = ctypes.CDLL(None, use_errno=True)

    class Filter(ctypes.Structure):
        _fields_ = (("count", ctypes.c_ushort), ("code", ctypes.c_void_p))

    libc.prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0)
    code = ctypes.create_string_buffer(program, len(program))
    given = Filter(len(program) // _INSTRUCTION_BYTES, ctypes.addressof(code))
    listener: int = libc.syscall(call, _SET_MODE_FILTER, _NEW_LISTENER, ctypes.byref(given))
    if listener == -1:
        number = ctypes.get_errno()
        raise OSError(number, f"seccomp: {os.strerror(number)}")
    return listener
