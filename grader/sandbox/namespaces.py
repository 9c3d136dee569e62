"""A forked process goes into namespaces of its own: each cell of a prefork server does.

The prefork server is in a sandbox already. A cell in it gets its own network (only a loopback
interface), processes, shared memory and scratch, and sees of all cells' folders its own alone.
"""

from __future__ import annotations

import contextlib
import ctypes
import fcntl
import os
import re
import signal
import socket
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from grader.sandbox.packet_monitor import PacketMonitor

CELL = Path("/cell")
"""Where a cell sees its folder."""
STUDENT = Path("/run/student")
"""Where it mounts what a student can write to: ``disk`` and ``shared``."""
MOUNT_POINTS = (CELL, STUDENT / "disk", STUDENT / "shared")

# linux/sched.h
_CLONE_NEWNS = 0x00020000
_CLONE_NEWUTS = 0x04000000
_CLONE_NEWIPC = 0x08000000
_CLONE_NEWUSER = 0x10000000
_CLONE_NEWPID = 0x20000000
_CLONE_NEWNET = 0x40000000
# linux/mount.h
_MS_RDONLY, _MS_NOSUID, _MS_NODEV, _MS_NOEXEC = 1, 2, 4, 8
_MS_BIND, _MS_REC, _MS_PRIVATE = 0x1000, 0x4000, 0x40000
# linux/prctl.h, linux/capability.h
_PR_SET_PDEATHSIG, _PR_CAPBSET_DROP, _PR_SET_NO_NEW_PRIVS = 1, 24, 38
_CAPABILITY_VERSION_3 = 0x20080522
_LAST_CAPABILITY = 63
# linux/sockios.h, linux/if.h
_SIOCGIFFLAGS, _SIOCSIFFLAGS, _IFF_UP = 0x8913, 0x8914, 1
_SIZES = struct.Struct("=QQQ")
_SHARED_FILES = 1000
_LOOK_S = 1.0
_TMP = Path("/tmp")
_ESCAPE = re.compile(r"\\([0-7]{3})")
_INTERFACE = struct.Struct("16sh14x")

_libc = ctypes.CDLL(None, use_errno=True)


class Mounter:
    """A process that keeps the right to mount, which the cell gives up, until sizes are known."""

    def __init__(self) -> None:
        self._end, theirs = socket.socketpair()
        self._pid = os.fork()
        if self._pid == 0:
            self._end.close()
            os.closerange(0, 3)
            self._serve(theirs)
        theirs.close()

    def mount(self, disk_bytes: int, files: int, shared_bytes: int) -> None:
        """Mount what students can write to, and end."""
        self._end.sendall(_SIZES.pack(disk_bytes, files, shared_bytes))
        number = int.from_bytes(self._end.recv(4), "little")
        self._end.close()
        os.waitpid(self._pid, 0)
        if number:
            raise OSError(number, f"mount: {os.strerror(number)}")

    @staticmethod
    def _serve(end: socket.socket) -> None:
        number = 0
        try:
            asked = end.recv(_SIZES.size)
            if not asked:
                os._exit(0)
            disk_bytes, files, shared_bytes = _SIZES.unpack(asked)
            for name, options in (
                ("disk", f"size={disk_bytes},nr_inodes={files},mode=755"),
                ("shared", f"size={shared_bytes},nr_inodes={_SHARED_FILES},mode=1777"),
            ):
                _mount("none", STUDENT / name, "tmpfs", _MS_NOSUID | _MS_NODEV, options)
            os.umask(0)
            (STUDENT / "disk" / "tmp").mkdir(mode=0o1777)
            (STUDENT / "disk" / "home").mkdir(mode=0o755)
        except OSError as error:
            number = error.errno or 1
        finally:
            end.sendall(number.to_bytes(4, "little"))
            os._exit(0)


@dataclass(frozen=True)
class Rights:
    """What a cell got hold of before it gave up its rights; packets where the kernel can."""

    mounter: Mounter
    packets: PacketMonitor | None


def enter(folder: Path, signal_to_send: Callable[[], int | None]) -> Rights:
    """Go on as the first process of new namespaces; the caller becomes the one that waits.

    Returns only in the new process. It dies with the one that waits, and everything in its
    namespaces with it.

    Args:
        folder: The cell's own; its parent holds those of all cells.
        signal_to_send: Called now and then by the one that waits: None to let the new process go
            on, or the signal that it shall seem to have been ended by.
    """
    uid, gid = os.getuid(), os.getgid()
    _call(
        "unshare",
        _CLONE_NEWUSER
        | _CLONE_NEWNS
        | _CLONE_NEWNET
        | _CLONE_NEWPID
        | _CLONE_NEWIPC
        | _CLONE_NEWUTS,
    )
    Path("/proc/self/setgroups").write_text("deny")
    Path("/proc/self/uid_map").write_text(f"{uid} {uid} 1")
    Path("/proc/self/gid_map").write_text(f"{gid} {gid} 1")
    child = os.fork()
    if child:
        _wait_for(child, signal_to_send)
    _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    _mount_own(folder)
    _bring_up_loopback()
    mounter = Mounter()
    packets = None
    with contextlib.suppress(OSError):
        packets = PacketMonitor()
    _drop_capabilities()
    return Rights(mounter, packets)


def _wait_for(child: int, signal_to_send: Callable[[], int | None]) -> None:
    os.closerange(0, 256)
    signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGCHLD,))
    ended, status = os.waitpid(child, os.WNOHANG)
    while not ended:
        signal.sigtimedwait((signal.SIGCHLD,), _LOOK_S)
        number = signal_to_send()
        if number is not None:
            # To the first process of a namespace every other signal means nothing.
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            os.kill(os.getpid(), number)
        ended, status = os.waitpid(child, os.WNOHANG)
    if os.WIFSIGNALED(status):
        os.kill(os.getpid(), os.WTERMSIG(status))
    os._exit(os.waitstatus_to_exitcode(status) & 0xFF)


def _mount_own(folder: Path) -> None:
    _mount(None, Path("/"), None, _MS_REC | _MS_PRIVATE)
    _mount(str(folder), CELL, None, _MS_BIND)
    _mount("none", folder.parent, "tmpfs", _MS_RDONLY, "size=0")
    # Python, ROS or rosgrade itself may be installed below /tmp: they are shown there again.
    shown = {
        path: os.open(path, os.O_PATH | os.O_CLOEXEC)
        for path in _mounted_below(_TMP)
        if path != folder.parent
    }
    for place in (_TMP, Path("/dev/shm")):
        _mount("none", place, "tmpfs", _MS_NOSUID | _MS_NODEV, "size=64m,mode=1777")
    for path, descriptor in shown.items():
        path.mkdir(parents=True)
        _mount(f"/proc/self/fd/{descriptor}", path, None, _MS_BIND | _MS_REC)
        os.close(descriptor)
    _mount("proc", Path("/proc"), "proc", _MS_NOSUID | _MS_NODEV | _MS_NOEXEC)


def _mounted_below(folder: Path) -> list[Path]:
    lines = Path("/proc/self/mountinfo").read_text(encoding="utf-8").splitlines()
    # The fifth field, with octal escapes for blanks and the like; source: proc(5).
    points = {Path(_ESCAPE.sub(lambda m: chr(int(m[1], 8)), line.split(" ")[4])) for line in lines}
    found: list[Path] = []
    for path in sorted(points):
        if folder in path.parents and path.is_dir() and not set(found) & set(path.parents):
            found.append(path)
    return found


def _bring_up_loopback() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        asked = _INTERFACE.pack(b"lo", 0)
        name, flags = _INTERFACE.unpack(fcntl.ioctl(any_socket, _SIOCGIFFLAGS, asked))
        fcntl.ioctl(any_socket, _SIOCSIFFLAGS, _INTERFACE.pack(name, flags | _IFF_UP))


def _drop_capabilities() -> None:
    for capability in range(_LAST_CAPABILITY + 1):
        # Those that this kernel does not know are not there to be dropped.
        _libc.prctl(_PR_CAPBSET_DROP, capability, 0, 0, 0)
    header = (ctypes.c_uint32 * 2)(_CAPABILITY_VERSION_3, 0)
    _call("capset", header, (ctypes.c_uint32 * 6)())
    _prctl(_PR_SET_NO_NEW_PRIVS, 1)


def _mount(
    source: str | None, target: Path, kind: str | None, flags: int, options: str = ""
) -> None:
    _call(
        "mount",
        None if source is None else source.encode(),
        os.fsencode(target),
        None if kind is None else kind.encode(),
        ctypes.c_ulong(flags),
        options.encode() or None,
    )


def _prctl(option: int, value: int) -> None:
    _call("prctl", option, ctypes.c_ulong(value), 0, 0, 0)


def _call(name: str, *arguments: object) -> None:
    if getattr(_libc, name)(*arguments) == -1:
        number = ctypes.get_errno()
        raise OSError(number, f"{name}: {os.strerror(number)}")
