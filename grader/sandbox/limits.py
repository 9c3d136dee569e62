"""How much of the machine untrusted code may take."""

from __future__ import annotations

import resource
from dataclasses import dataclass

MIB = 2**20
OPEN_FILES = 1024
_OWN_SHARE = 4
"""Descriptors in flight between processes (SCM_RIGHTS, unix(7)) count for all that a user runs, and
a process that may have more open may send more: a submission must not use up the grader's."""
_WANTED_FILES = 8 * OPEN_FILES
_SIGNALS = 1024
_CPU_GRACE_S = 10
"""The watchdog counts all processes together: it comes first, and says what happened."""


@dataclass(frozen=True)
class SandboxLimits:
    """Bounds of one sandbox.

    Attributes:
        open_files: Of all processes together, sockets and the like among them; the kernel holds
            each process to it, or to a quarter of what the grader itself may have open.
        address_bytes: Address space of one process. Reserving takes no memory, and every thread
            reserves some, so this is far more than the memory.
    """

    memory_bytes: int = 1024 * MIB
    processes: int = 128
    cpu_s: int = 300
    file_bytes: int = 32 * MIB
    disk_bytes: int = 64 * MIB
    files: int = 20_000
    shared_bytes: int = 16 * MIB
    open_files: int = OPEN_FILES
    address_bytes: int = 4096 * MIB
    output_bytes: int = 2048 * MIB

    def prlimit(self, more_processes: int = 0) -> list[str]:
        """The command in front of what is to be bounded; limits are soft and hard.

        The number of processes counts per user namespace where it is set inside, and over all that
        the user runs where it is set outside.
        """
        own_files, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
        share = OPEN_FILES if own_files == resource.RLIM_INFINITY else own_files // _OWN_SHARE
        bounds = {
            "as": self.address_bytes,
            "data": self.memory_bytes,
            "nproc": self.processes + more_processes,
            "nofile": min(self.open_files, share),
            "fsize": self.file_bytes,
            "cpu": self.cpu_s + _CPU_GRACE_S,
            "sigpending": _SIGNALS,
            "core": 0,
        }
        return ["prlimit", *(f"--{name}={bound}" for name, bound in bounds.items())]


def raise_open_files() -> None:
    """Get as many open files for this process, and those that it starts, as a class may need."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != resource.RLIM_INFINITY and soft < _WANTED_FILES:
        soft = _WANTED_FILES if hard == resource.RLIM_INFINITY else min(_WANTED_FILES, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


BUILD_OUTPUT_BYTES = 64 * MIB
BUILD = SandboxLimits(
    memory_bytes=2048 * MIB,
    processes=128,
    cpu_s=600,
    file_bytes=256 * MIB,
    disk_bytes=1024 * MIB,
    files=40_000,
    address_bytes=8192 * MIB,
    output_bytes=BUILD_OUTPUT_BYTES,
)
"""Of a build: compilers take more than nodes."""


def size_words(size: int) -> str:
    """A size for people: ``64 MiB``, or ``100 KiB`` where it is small."""
    return f"{size // MIB} MiB" if size >= 10 * MIB or size % MIB == 0 else f"{size // 1024} KiB"
