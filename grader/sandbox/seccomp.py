"""The filter of system calls that every untrusted process runs under.

Made by libseccomp through pyseccomp, which knows the call numbers of each architecture. What is
refused fails with EPERM, as it would for lack of a privilege; calls of another architecture
(32 bit, x32) end the process.
"""

from __future__ import annotations

import errno
import tempfile
from typing import Any

_REFUSED = (
    # Other processes.
    *("ptrace", "process_vm_readv", "process_vm_writev", "process_madvise", "kcmp"),
    *("pidfd_getfd", "perf_event_open", "bpf", "userfaultfd"),
    # Keys are shared by all of a user's processes, in whatever namespace.
    *("add_key", "request_key", "keyctl"),
    *("io_uring_setup", "io_uring_enter", "io_uring_register"),
    # Namespaces and mounts.
    *("mount", "umount2", "pivot_root", "chroot", "unshare", "setns", "mount_setattr"),
    *("open_tree", "move_mount", "fsopen", "fsconfig", "fsmount", "fspick"),
    *("open_by_handle_at", "name_to_handle_at", "quotactl", "quotactl_fd", "fanotify_init"),
    # The machine.
    *("init_module", "finit_module", "delete_module", "kexec_load", "kexec_file_load"),
    *("reboot", "swapon", "swapoff", "acct", "syslog", "settimeofday", "stime", "adjtimex"),
    *("clock_settime", "clock_adjtime", "iopl", "ioperm", "modify_ldt", "personality"),
    *("lookup_dcookie", "vhangup", "nfsservctl", "uselib"),
    # Memory that belongs to no process and to no file system with a bound.
    *("memfd_create", "memfd_secret", "shmget", "shmat", "shmctl", "semget", "semop"),
    *("msgget", "msgsnd", "mq_open"),
)
# A process on a CPU of its own choice takes time from its neighbours: it is told that it got what
# it asked for.
_PRETENDED = (
    *("sched_setaffinity", "sched_setscheduler", "sched_setparam", "sched_setattr"),
    *("ioprio_set",),
)
# CLONE_NEWNS, NEWCGROUP, NEWUTS, NEWIPC, NEWUSER, NEWPID, NEWNET, NEWTIME: linux/sched.h
_NAMESPACES = (0x20000, 0x2000000, 0x4000000, 0x8000000, 0x10000000, 0x20000000, 0x40000000, 0x80)
_TIOCSTI, _TIOCLINUX = 0x5412, 0x541C
_INT = 0xFFFFFFFF
# AF_UNIX, AF_INET, AF_INET6, AF_NETLINK (getifaddrs): linux/socket.h
_FAMILIES = (1, 2, 10, 16)
_FAMILY_BITS = 6


def student_filter(*, one_session: bool = False) -> bytes:
    """Assemble the filter, as the BPF program that ``bwrap --seccomp`` takes.

    Args:
        one_session: Also keep all processes in one session, as the kernel shares the CPU between
            sessions. A daemon then gets the signals that are meant for its parent.

    Raises:
        RuntimeError: libseccomp is not there.
    """
    import pyseccomp as seccomp

    rules = seccomp.SyscallFilter(seccomp.ALLOW)
    refuse = seccomp.ERRNO(errno.EPERM)
    for name in _REFUSED:
        _add(rules, refuse, name)
    for name in (*_PRETENDED, *(["setsid"] if one_session else [])):
        _add(rules, seccomp.ERRNO(0), name)
    for flag in _NAMESPACES:
        _add(rules, refuse, "clone", seccomp.Arg(0, seccomp.MASKED_EQ, flag, flag))
    # Its flags are in memory, where a filter cannot look; libc then uses clone.
    _add(rules, seccomp.ERRNO(errno.ENOSYS), "clone3")
    for request in (_TIOCSTI, _TIOCLINUX):
        _add(rules, refuse, "ioctl", seccomp.Arg(1, seccomp.MASKED_EQ, _INT, request))
    for call in ("socket", "socketpair"):
        for family in range(1 << _FAMILY_BITS):
            if family not in _FAMILIES:
                _add(rules, refuse, call, seccomp.Arg(0, seccomp.MASKED_EQ, _INT, family))
        # The kernel looks at 32 of the 64 bits, and so must the rule.
        for bit in range(_FAMILY_BITS, 32):
            flag = 1 << bit
            _add(rules, refuse, call, seccomp.Arg(0, seccomp.MASKED_EQ, flag, flag))
    with tempfile.TemporaryFile() as file:
        rules.export_bpf(file)
        file.seek(0)
        return file.read()


def _add(rules: Any, action: Any, name: str, *arguments: Any) -> None:
    from pyseccomp import resolve_syscall, system_arch

    # A call that this libseccomp or this architecture does not know has no number to filter.
    if resolve_syscall(system_arch(), name) != -1:
        rules.add_rule(action, name, *arguments)
