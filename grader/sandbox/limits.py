"""How much of the machine untrusted code may take."""

from __future__ import annotations

import resource
from dataclasses import dataclass

from grader.errors import GraderFault

MIB = 2**20
OPEN_FILES = 1024
_OWN_SHARE = 4
"""What is on its way between processes (SCM_RIGHTS, unix(7)) counts for all that a user runs, and
who may have more open may send more: a submission must not use up what the grader needs."""
_SIGNALS = 1024
_CPU_GRACE_S = 10
"""Whoever counts all processes together comes first, and can say what happened."""


_OPTIONS = {
    "as": resource.RLIMIT_AS,
    "data": resource.RLIMIT_DATA,
    "nproc": resource.RLIMIT_NPROC,
    "nofile": resource.RLIMIT_NOFILE,
    "fsize": resource.RLIMIT_FSIZE,
    "cpu": resource.RLIMIT_CPU,
    "sigpending": resource.RLIMIT_SIGPENDING,
    "core": resource.RLIMIT_CORE,
}
"""Of prlimit(1)."""


@dataclass(frozen=True)
class SandboxLimits:
    """Bounds of one sandbox.

    Attributes:
        open_files: Of all processes together, sockets and the like among them; the kernel holds
            each process to it, or to a quarter of what we may have open.
        address_bytes: Address space of one process. Reserving takes nothing from anybody, and
            every thread reserves some, so this is far more than the memory.
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

    def check_allowed(self) -> None:
        """See that the shell that started us leaves so much to untrusted code.

        Raises:
            GraderFault: It leaves less, and nothing at all could be started.
        """
        for what, option, unit, wanted in (
            (resource.RLIMIT_AS, "v", 1024, self.address_bytes),
            (resource.RLIMIT_DATA, "d", 1024, self.memory_bytes),
            (resource.RLIMIT_NPROC, "u", 1, self.processes),
            (resource.RLIMIT_NOFILE, "n", 1, self.open_files),
            (resource.RLIMIT_FSIZE, "f", 1024, self.file_bytes),
            (resource.RLIMIT_CPU, "t", 1, self.cpu_s + _CPU_GRACE_S),
        ):
            _, allowed = resource.getrlimit(what)
            if allowed != resource.RLIM_INFINITY and allowed < wanted:
                raise GraderFault(
                    f"`ulimit -H{option}` is {allowed // unit} in the shell that grades, and in "
                    f"the sandbox a submission may use {wanted // unit}: allow as much, or grade "
                    "with --sandbox none"
                )

    def rlimits(self) -> dict[int, int]:
        """What :meth:`prlimit` sets: resource -> bound, soft and hard."""
        own_files, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
        return {
            resource.RLIMIT_AS: self.address_bytes,
            resource.RLIMIT_DATA: self.memory_bytes,
            resource.RLIMIT_NPROC: self.processes,
            resource.RLIMIT_NOFILE: min(self.open_files, _share(own_files)),
            resource.RLIMIT_FSIZE: self.file_bytes,
            resource.RLIMIT_CPU: self.cpu_s + _CPU_GRACE_S,
            resource.RLIMIT_SIGPENDING: _SIGNALS,
            resource.RLIMIT_CORE: 0,
        }

    def prlimit(self, more_processes: int = 0) -> list[str]:
        """The command in front of what is to be bounded.

        The number of processes counts per user and user namespace where it is set inside, and
        over everything of the user where it is set outside.
        """
        bounds = self.rlimits()
        bounds[resource.RLIMIT_NPROC] += more_processes
        return ["prlimit", *(f"--{name}={bounds[what]}" for name, what in _OPTIONS.items())]


def _share(own_files: int) -> int:
    return OPEN_FILES if own_files == resource.RLIM_INFINITY else own_files // _OWN_SHARE


def raise_open_files(wanted: int = _OWN_SHARE * OPEN_FILES) -> int:
    """Get so many open files for this process and those that it starts; how many there are.

    Most shells allow 1024, and up to some larger number whoever asks: see getrlimit(2).
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = max(wanted, _OWN_SHARE * OPEN_FILES)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        soft = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    return soft


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
