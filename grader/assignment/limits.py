"""How much of the machine a submission may take, as an author writes it."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field

from grader.sandbox.limits import BUILD, BUILD_OUTPUT_BYTES, SandboxLimits
from grader.spec.quantity import Duration, Size
from grader.spec.source import Model

_DEFAULTS = SandboxLimits()


class _Bounds(Model):
    """What the options of runs and builds have in common; each says its own defaults."""

    _least_address_bytes: ClassVar[int]

    memory: Size
    processes: int
    cpu_time: Duration
    file_size: Size
    disk: Size
    files: int
    output: Size

    def limits(self) -> SandboxLimits:
        """For the sandbox."""
        return SandboxLimits(
            memory_bytes=int(self.memory),
            processes=self.processes,
            cpu_s=max(1, round(self.cpu_time)),
            file_bytes=int(self.file_size),
            disk_bytes=int(self.disk),
            files=self.files,
            output_bytes=int(self.output),
            address_bytes=max(self._least_address_bytes, 4 * int(self.memory)),
        )


class LimitOptions(_Bounds):
    """What the processes of a student may take in a sandbox.

    Without a sandbox nothing is bounded but time. How long a run lasts is bounded by
    `discovery`, `timeout` and `shutdown`.
    """

    _least_address_bytes = _DEFAULTS.address_bytes

    memory: Size = Field(
        _DEFAULTS.memory_bytes, description="Of all processes together.", validate_default=False
    )
    processes: int = Field(
        _DEFAULTS.processes,
        ge=16,
        le=4096,
        description="Processes and threads together; a node of rclpy has 14 threads.",
    )
    cpu_time: Duration = Field(
        _DEFAULTS.cpu_s, description="CPU time of all processes together.", validate_default=False
    )
    file_size: Size = Field(
        _DEFAULTS.file_bytes, description="Size of one file.", validate_default=False
    )
    disk: Size = Field(
        _DEFAULTS.disk_bytes,
        description="Everything in home and /tmp; it is kept in memory.",
        validate_default=False,
    )
    files: int = Field(_DEFAULTS.files, ge=100, description="Files and folders in home and /tmp.")
    output: Size = Field(
        _DEFAULTS.output_bytes,
        description="Output to the terminal; a program that writes more is ended.",
        validate_default=False,
    )


class BuildLimitOptions(_Bounds):
    """What the build of a submission may take; `setup.py` and `CMakeLists.txt` are programs, too.

    Without a sandbox only `wall_time` and `output` are bounded. A build that passes a limit has
    failed.
    """

    _least_address_bytes = BUILD.address_bytes

    memory: Size = Field(
        BUILD.memory_bytes, description="Of all processes together.", validate_default=False
    )
    processes: int = Field(
        BUILD.processes, ge=16, le=4096, description="Processes and threads together."
    )
    cpu_time: Duration = Field(
        BUILD.cpu_s, description="CPU time of all processes together.", validate_default=False
    )
    wall_time: Duration | None = Field(
        None,
        description="Of the whole build; by default 2 min where all packages are ament_python, "
        "else 5 min.",
    )
    file_size: Size = Field(
        BUILD.file_bytes, description="Size of one file.", validate_default=False
    )
    disk: Size = Field(
        BUILD.disk_bytes, description="Everything that it writes.", validate_default=False
    )
    files: int = Field(BUILD.files, ge=100, description="Files and folders that it makes.")
    output: Size = Field(
        BUILD_OUTPUT_BYTES,
        description="Output to the terminal; a program that writes more is ended.",
        validate_default=False,
    )
