"""The filter of system calls that every untrusted process runs under.

Made by libseccomp through pyseccomp, which knows the call numbers of each architecture. What is
refused fails with EPERM, as it would for lack of a privilege; calls of another architecture
(32 bit, x32) end the process.
"""

from __future__ import annotations

import errno
import signal
import tempfile
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

_INT = 0xFFFFFFFF
_AIMED = {"ptrace": 1, "process_vm_readv": 0, "process_vm_writev": 0}
"""Calls on another process, and which argument is its id; refused for every id."""
_SIGNALLING = {
    **{"kill": 1, "tkill": 1, "rt_sigqueueinfo": 1},
    **{"tgkill": 2, "rt_tgsigqueueinfo": 2},
}
"""Calls that send a signal to the process of their first argument, and where the signal is."""
_UNHEARD_OF = (
    *("setns", "open_by_handle_at", "bpf", "reboot", "swapon", "swapoff"),
    # Asynchronous I/O has one limit for the whole machine.
    "io_setup",
    *("init_module", "finit_module", "delete_module", "kexec_load", "kexec_file_load"),
)
"""Calls that no node and no library of one has a use for."""
COUNTED = ("inotify_init", "inotify_init1")
"""Calls that make something for which all processes of a user share one limit."""
MOST_COUNTED = 8
_ENDING = (signal.SIGKILL, signal.SIGSTOP, signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU)
# RLIMIT_CPU and F_SETSIG: asm-generic/resource.h, linux/fcntl.h. A program may also end with the
# status by which a shell tells of a signal.
_RLIMIT_CPU, _F_SETSIG, _SIGNALLED = 0, 10, 128
# TIOCSPTLCK and TIOCGPTPEER: asm-generic/ioctls.h
_TERMINAL = (0x40045431, 0x5441)


class _Way(NamedTuple):
    """A system call with certain values of one argument, of which the bits of a mask count."""

    call: str
    argument: int
    values: tuple[int, ...]
    mask: int = _INT


_WAYS_TO_END = (
    *(_Way(name, place, _ENDING) for name, place in _SIGNALLING.items()),
    _Way("pidfd_send_signal", 1, _ENDING),
    _Way("fcntl", 1, (_F_SETSIG,)),
    # The keys of a terminal stop what runs there. A new one is locked, or its other end opened.
    _Way("ioctl", 1, _TERMINAL),
    # At the end of its CPU time the kernel kills a process.
    _Way("setrlimit", 0, (_RLIMIT_CPU,)),
    _Way("prlimit64", 1, (_RLIMIT_CPU,)),
    *(
        _Way(name, 0, tuple(_SIGNALLED + number for number in _ENDING), mask=0xFF)
        for name in ("exit", "exit_group")
    ),
    # Its signal is in memory, where a filter cannot look.
    _Way("timer_create", 0, (0,), mask=0),
)
"""Ways to kill or to stop a process within a sandbox, or to pretend that."""
LEADER = 2
"""What a sandbox is started with; of a build that is colcon."""
INIT = 1
"""The first process of a sandbox, the only one in it that is not the student's."""
_REFUSED = (
    # Other processes.
    *("process_madvise", "kcmp", "pidfd_getfd", "perf_event_open", "userfaultfd"),
    # Keys are shared by all of a user's processes, in all namespaces.
    *("add_key", "request_key", "keyctl"),
    *("io_uring_setup", "io_uring_enter", "io_uring_register"),
    # Namespaces and mounts.
    *("mount", "umount2", "pivot_root", "chroot", "unshare", "mount_setattr"),
    *("open_tree", "move_mount", "fsopen", "fsconfig", "fsmount", "fspick"),
    *("name_to_handle_at", "quotactl", "quotactl_fd", "fanotify_init"),
    # The machine.
    *("acct", "syslog", "settimeofday", "stime", "adjtimex"),
    *("clock_settime", "clock_adjtime", "iopl", "ioperm", "modify_ldt", "personality"),
    *("lookup_dcookie", "vhangup", "nfsservctl", "uselib"),
    # Memory that belongs to no process and to no file system with a bound.
    *("memfd_create", "memfd_secret", "shmget", "shmat", "shmctl", "semget", "semop"),
    *("msgget", "msgsnd", "mq_open"),
)
# A process on a CPU of its own choice takes time from its neighbours: these calls do nothing, and
# report success.
_PRETENDED = (
    *("sched_setaffinity", "sched_setscheduler", "sched_setparam", "sched_setattr"),
    *("ioprio_set",),
)
# SOL_SOCKET; SO_SNDBUF, SO_RCVBUF and both FORCE: asm-generic/socket.h. What waits in a socket is
# memory of the kernel's that is counted for no process, so each has the system's usual room.
_SOCKET_LEVEL, _BUFFER_SIZES = 1, (7, 8, 32, 33)
# CLONE_NEWNS, NEWCGROUP, NEWUTS, NEWIPC, NEWUSER, NEWPID, NEWNET, NEWTIME: linux/sched.h
_NAMESPACES = (0x20000, 0x2000000, 0x4000000, 0x8000000, 0x10000000, 0x20000000, 0x40000000, 0x80)
_TIOCSTI, _TIOCLINUX = 0x5412, 0x541C
# F_SETOWN and F_SETOWN_EX; FIOSETOWN and SIOCSPGRP: asm-generic/fcntl.h, sockios.h
_OWNERS, _OWNING = (8, 15), (0x8901, 0x8902)
# linux/fcntl.h: a user has a certain number of pages in pipes.
_F_SETPIPE_SZ = 1031
# AF_UNIX, AF_INET, AF_INET6, AF_NETLINK (getifaddrs): linux/socket.h
_FAMILIES = (1, 2, 10, 16)
_FAMILY_BITS = 6


@cache
def student_filter(*, one_session: bool = False, guarded: bool = False) -> bytes:
    """Assemble the filter, as the BPF program that ``bwrap --seccomp`` takes.

    Args:
        one_session: For a build: also keep all processes in one session, as the kernel shares
            the CPU between sessions, and let none of them send a signal to what started them.
    """
    import pyseccomp as seccomp

    rules = seccomp.SyscallFilter(seccomp.ALLOW)
    refuse = seccomp.ERRNO(errno.EPERM)
    for name in (*_REFUSED, *([] if guarded else [*_AIMED, *_UNHEARD_OF, *COUNTED])):
        _add(rules, refuse, name)
    for name in (*_PRETENDED, *(["setsid"] if one_session else [])):
        _add(rules, seccomp.ERRNO(0), name)
    for flag in _NAMESPACES:
        _add(rules, refuse, "clone", seccomp.Arg(0, seccomp.MASKED_EQ, flag, flag))
    # Its flags are in memory, where a filter cannot look; libc then uses clone.
    _add(rules, seccomp.ERRNO(errno.ENOSYS), "clone3")
    if one_session:
        for target in (0, -1, INIT, -INIT, LEADER, -LEADER):
            at_leader = seccomp.Arg(0, seccomp.MASKED_EQ, _INT, target & _INT)
            for name in (*_SIGNALLING, "pidfd_open"):
                _add(rules, refuse, name, at_leader)
    # The limits of another process, and signals by way of a file that is ready.
    _add(rules, refuse, "prlimit64", seccomp.Arg(0, seccomp.NE, 0))
    for command in (*_OWNERS, _F_SETPIPE_SZ):
        _add(rules, refuse, "fcntl", seccomp.Arg(1, seccomp.MASKED_EQ, _INT, command))
    for request in (_TIOCSTI, _TIOCLINUX, *_OWNING):
        _add(rules, refuse, "ioctl", seccomp.Arg(1, seccomp.MASKED_EQ, _INT, request))
    for option in _BUFFER_SIZES:
        level = seccomp.Arg(1, seccomp.MASKED_EQ, _INT, _SOCKET_LEVEL)
        wanted = seccomp.Arg(2, seccomp.MASKED_EQ, _INT, option)
        _add(rules, seccomp.ERRNO(0), "setsockopt", level, wanted)
    for call in ("socket", "socketpair"):
        for family in range(1 << _FAMILY_BITS):
            if family not in _FAMILIES:
                _add(rules, refuse, call, seccomp.Arg(0, seccomp.MASKED_EQ, _INT, family))
        # The kernel looks at 32 of the 64 bits, and so must the rule.
        for bit in range(_FAMILY_BITS, 32):
            flag = 1 << bit
            _add(rules, refuse, call, seccomp.Arg(0, seccomp.MASKED_EQ, flag, flag))
    return _program(rules)


@cache
def guard_filter() -> bytes:
    """Assemble the filter around a student's sandbox, which asks a guard before it refuses.

    It is in force while bubblewrap makes the sandbox, so it holds only calls that bubblewrap
    itself does not need, or that the guard lets go on.
    """
    import pyseccomp as seccomp

    rules = seccomp.SyscallFilter(seccomp.ALLOW)
    for name in (*_AIMED, *_UNHEARD_OF, *COUNTED):
        _add(rules, seccomp.NOTIFY, name)
    at_init = seccomp.Arg(0, seccomp.MASKED_EQ, _INT, INIT)
    for name, place in _SIGNALLING.items():
        # Signal 0 only asks whether the process is there.
        _add(rules, seccomp.NOTIFY, name, at_init, seccomp.Arg(place, seccomp.NE, 0))
    _add(rules, seccomp.NOTIFY, "pidfd_open", at_init)
    for way in _WAYS_TO_END:
        for value in way.values:
            argument = seccomp.Arg(way.argument, seccomp.MASKED_EQ, way.mask, value)
            _add(rules, seccomp.NOTIFY, way.call, argument)
    return _program(rules)


@cache
def guarded_calls() -> dict[str, int]:
    """The numbers of the calls that :func:`guard_filter` asks about, and of ``seccomp`` itself."""
    from pyseccomp import resolve_syscall, system_arch

    names = (*_AIMED, *_UNHEARD_OF, *COUNTED, *(way.call for way in _WAYS_TO_END))
    return {
        name: resolve_syscall(system_arch(), name) for name in (*names, "pidfd_open", "seccomp")
    }


def can_end(name: str, arguments: Sequence[int]) -> bool:
    """Whether a call can kill or stop a process of the same sandbox, which is allowed."""
    return any(
        name == way.call and arguments[way.argument] & way.mask in way.values
        for way in _WAYS_TO_END
    )


def violation_of(name: str, arguments: Sequence[int]) -> str | None:
    """What a process did by a system call that the guard saw; None if it does no harm."""
    if name in _UNHEARD_OF:
        return f"called `{name}`"
    if name in COUNTED:
        return f"called `{name}` more than {MOST_COUNTED} times"
    place = {**dict.fromkeys((*_SIGNALLING, "pidfd_open"), 0), **_AIMED}.get(name)
    if place is None or arguments[place] & _INT != INIT:
        # A debugger or a sanitizer looks at the student's own processes.
        return None
    if name not in _SIGNALLING:
        return f"called `{name}` on the process that holds their sandbox"
    number = arguments[_SIGNALLING[name]] & _INT
    known = {int(one): one.name for one in signal.Signals}
    return f"sent {known.get(number, f'signal {number}')} to the process that holds their sandbox"


def _program(rules: Any) -> bytes:
    with tempfile.TemporaryFile() as file:
        rules.export_bpf(file)
        file.seek(0)
        return file.read()


def _add(rules: Any, action: Any, name: str, *arguments: Any) -> None:
    from pyseccomp import resolve_syscall, system_arch

    # A call that this libseccomp or this architecture does not know has no number to filter.
    if resolve_syscall(system_arch(), name) != -1:
        rules.add_rule(action, name, *arguments)
