"""An interpreter that has imported ahead, and goes on as the student's program in forks.

Python imports ``sitecustomize`` before it opens the program that it was started with. A zygote
stops there: it imports what programs of the course import, puts all of it aside and waits. For
each run it forks, and the fork enters the run's sandbox and returns to the start of Python, which
then opens and runs the program as it always does: with the same ``__main__``, tracebacks, signals
and exit.

What was imported ahead is put aside (see ``_rosgrade_ahead``). Where a folder of the student's
holds a module of the name of one of these, the fork starts Python anew.

Only the standard library may be used here.
"""

from __future__ import annotations

import os
import sys

from _rosgrade_ahead import Ahead  # type: ignore[import-not-found]

TYPE_CHECKING = False
if TYPE_CHECKING:
    import ctypes
    import gc
    import json
    import resource
    import signal
    import socket
    from collections.abc import Mapping
    from typing import Any

_VARIABLE = "ROSGRADE_ZYGOTE_FD"
_FORKED = b"forked"
_OWN = ("ctypes", "gc", "importlib", "json", "resource", "signal", "socket")
_REQUEST_BYTES = 65_536
_DESCRIPTORS = 8
# linux/sched.h: CLONE_NEWNS, NEWUTS, NEWIPC, NEWUSER, NEWPID, NEWNET
_NAMESPACES = 0x0002_0000 | 0x0400_0000 | 0x0800_0000 | 0x1000_0000 | 0x2000_0000 | 0x4000_0000
_CLONE_NEWCGROUP = 0x0200_0000
# linux/prctl.h, linux/seccomp.h, linux/capability.h
_PR_SET_DUMPABLE, _PR_SET_SECCOMP, _PR_CAPBSET_DROP, _PR_SET_NO_NEW_PRIVS = 4, 22, 24, 38
_SECCOMP_MODE_FILTER, _SET_MODE_FILTER, _NEW_LISTENER = 2, 1, 1 << 3
_CAPABILITY_VERSION_3 = 0x20080522
_LAST_CAPABILITY = 63
_INSTRUCTION_BYTES = 8
_SIGNALS = b"\xff" * 128
"""All, as the C library has them."""
_CALLS = 3
"""Of LTTng-UST, around a fork."""
_STANDARD = 3
"""Descriptors of the standard streams."""
_SIGNALLED = 128
"""A shell and bubblewrap report a signal so."""


def serve() -> None:
    """Wait for runs; returns in the fork that is to be a student's program."""
    try:
        _serve()
    except BaseException:
        # Nothing of a student's runs outside of a sandbox. Whoever asked sees the end of the reply.
        os._exit(1)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())


def _serve() -> None:
    ahead = Ahead()
    ahead.load(_OWN)
    for name in _OWN:
        globals()[name] = ahead.module(name)
    with socket.socket(fileno=int(os.environ.pop(_VARIABLE))) as asked:
        told = json.loads(asked.recv(_REQUEST_BYTES))
        ahead.load(told["imports"])
        # Pages that the collector touches would be copied by every fork.
        gc.collect()
        gc.freeze()
        has_forked = False
        tracing = _Tracing()
        while True:
            # Ready, also for the next one.
            asked.send(str(sum(os.times()[:4])).encode())
            text, descriptors, _, _ = socket.recv_fds(asked, _REQUEST_BYTES, _DESCRIPTORS)
            if not text:
                os._exit(0)
            tracing.before_fork()
            pid = os.fork()
            if not pid:
                break
            tracing.after_fork("parent")
            for descriptor in descriptors:
                os.close(descriptor)
            _, status = os.waitpid(pid, 0)
            has_forked = has_forked or not status
            if not has_forked:
                # The system does not let it join a sandbox.
                os._exit(1)
    request = json.loads(text)
    tracer, seen = _enter(request, descriptors, told["seccomp"])
    pipes = {"ROSGRADE_TRACER_FD": str(tracer), "ROSGRADE_SEEN_FD": str(seen)}
    _become({**request["environment"], **pipes}, ahead, tracing)


class _Tracing:
    """LTTng-UST, which ROS loads: as a program ends, it cancels its threads, and a fork has none.

    Its own calls around a fork make new ones there; without them that end is a crash.
    """

    def __init__(self) -> None:
        """Find it; it may not be there."""
        self._signals = ctypes.create_string_buffer(_SIGNALS, len(_SIGNALS))
        self._calls: dict[str, Any] = {}
        with open("/proc/self/maps", encoding="utf-8") as maps:
            files = {line.split()[-1] for line in maps if "/liblttng-ust" in line}
        for library in map(ctypes.CDLL, files):
            for prefix in ("lttng_ust_", "ust_"):
                for name in ("before_fork", "after_fork_parent", "after_fork_child"):
                    if hasattr(library, prefix + name):
                        self._calls[name] = getattr(library, prefix + name)

    def before_fork(self) -> None:
        """Let its threads hold nothing."""
        if len(self._calls) == _CALLS:
            self._calls["before_fork"](self._signals)

    def after_fork(self, side: str) -> None:
        """Let them go on, or begin anew in a child, which blocks all signals."""
        if len(self._calls) == _CALLS:
            signals = self._signals if side == "parent" else _SIGNALS
            self._calls[f"after_fork_{side}"](signals)


def _enter(request: Mapping[str, Any], descriptors: list[int], call: int) -> tuple[int, int]:
    """Go on as the student's process in a sandbox; the others of the way there end.

    All signals are blocked in it.

    Args:
        request: Of the cell.
        descriptors: Given with it.
        call: Number of seccomp(2).

    Returns:
        Descriptors of the tracer's pipes.
    """
    sandbox, stdout, stderr, guard, rules, tracer, seen, told = descriptors
    libc = ctypes.CDLL(None, use_errno=True)
    # Not every kernel makes a new cgroup namespace, and the same one may not be joined again.
    if libc.setns(sandbox, _NAMESPACES | _CLONE_NEWCGROUP) == -1:
        _call(libc.setns, sandbox, _NAMESPACES)
    # A process is adopted within the namespace of its parent: this one's child is the first in it.
    child = os.fork()
    if child:
        os.waitpid(child, 0)
        os._exit(0)
    if os.fork():
        os._exit(0)
    os.setsid()
    os.chdir(request["folder"])
    for number, value in request["limits"]:
        resource.setrlimit(number, (value, value))
    listener = _give_up_rights(libc, guard, rules, call)
    nothing = os.open(os.devnull, os.O_RDONLY)
    for target, descriptor in enumerate((nothing, stdout, stderr)):
        os.dup2(descriptor, target)
    for descriptor in (sandbox, stdout, stderr, guard, rules, nothing):
        os.close(descriptor)
    # The student's process group is this one's, and none of its signals is meant for it. Nor may
    # the student's process look into it, and write what it tells.
    signal.pthread_sigmask(signal.SIG_SETMASK, signal.valid_signals())
    _call(libc.prctl, _PR_SET_DUMPABLE, 0, 0, 0, 0)
    reply = socket.socket(fileno=told)
    # Before it says that it has forked: what cannot be forked is begun anew.
    child = os.fork()
    if child:
        socket.send_fds(reply, [_FORKED], [] if listener is None else [listener])
        _wait_for(child, (tracer, seen, *([] if listener is None else [listener])), reply)
    if listener is not None:
        os.close(listener)
    # Whoever has waited too long has begun anew, and this program must not run as well.
    if not reply.recv(1):
        os._exit(1)
    reply.close()
    _call(libc.prctl, _PR_SET_DUMPABLE, 1, 0, 0, 0)
    return tracer, seen


def _wait_for(child: int, given: tuple[int, ...], reply: socket.socket) -> None:
    """Tell how a process ended, and end."""
    for descriptor in {*range(_STANDARD), *given}:
        os.close(descriptor)
    _, status = os.waitpid(child, 0)
    code = os.waitstatus_to_exitcode(status)
    reply.send(str(code if code >= 0 else _SIGNALLED - code).encode())
    os._exit(0)


def _give_up_rights(libc: Any, guard: int, rules: int, call: int) -> int | None:
    """Keep no rights, and let the kernel refuse what students may not do.

    Returns:
        What the kernel asks the guard through; see :mod:`grader.run.guard`.
    """
    for capability in range(_LAST_CAPABILITY + 1):
        # Those that this kernel does not know are not there to be dropped.
        libc.prctl(_PR_CAPBSET_DROP, capability, 0, 0, 0)
    header = (ctypes.c_uint32 * 2)(_CAPABILITY_VERSION_3, 0)
    _call(libc.capset, header, (ctypes.c_uint32 * 6)())
    _call(libc.prctl, _PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0)
    asking = _filter(guard)
    listener = libc.syscall(call, _SET_MODE_FILTER, _NEW_LISTENER, ctypes.byref(asking))
    if listener == -1:
        _call(libc.syscall, call, _SET_MODE_FILTER, 0, ctypes.byref(asking))
    refusing = _filter(rules)
    _call(libc.prctl, _PR_SET_SECCOMP, _SECCOMP_MODE_FILTER, ctypes.byref(refusing), 0, 0)
    return listener if listener != -1 else None


def _filter(file: int) -> Any:
    program = os.pread(file, _REQUEST_BYTES, 0)
    code = ctypes.create_string_buffer(program, len(program))

    class Filter(ctypes.Structure):
        _fields_ = (
            ("count", ctypes.c_ushort),
            ("code", ctypes.c_void_p),
            ("held", ctypes.py_object),
        )

    return Filter(
        len(program) // _INSTRUCTION_BYTES, ctypes.addressof(code), ctypes.py_object(code)
    )


def _call(function: Any, *arguments: Any) -> None:
    if function(*arguments) == -1:
        raise OSError(ctypes.get_errno(), function.__name__)


def _become(environment: Mapping[str, str], ahead: Ahead, tracing: _Tracing) -> None:
    """Be as Python is at its start."""
    os.environ.clear()
    os.environ.update(environment)
    if ahead.roots & _modules_of(sys.orig_argv[1]):
        # What is blocked stays so in whatever is executed.
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_SETMASK, ())
        os.execv(sys.executable, sys.orig_argv)
    for name in (__name__, Ahead.__module__):
        del sys.modules[name]
    tracing.after_fork("child")
    _renew_main()
    ahead.be_a_fork()
    ahead.be_as_at_the_start()
    ctypes.set_errno(0)


def _renew_main() -> None:
    """Let what the program leaves in ``__main__`` end with it: the old one is frozen."""
    main = type(sys)("__main__")
    vars(main).update(vars(sys.modules["__main__"]))
    sys.modules["__main__"] = main


def _modules_of(program: str) -> set[str]:
    """Names of the modules that a program finds in folders of the student's."""
    install = os.path.dirname(os.path.dirname(os.path.dirname(program)))
    folders = {path for path in sys.path if path.startswith(f"{install}/")}
    found: set[str] = set()
    for folder in {*folders, os.path.dirname(os.path.realpath(program))}:
        if os.path.isdir(folder):
            found.update(name.partition(".")[0] for name in os.listdir(folder))
    return found
