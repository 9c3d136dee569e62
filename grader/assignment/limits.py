"""The models of ``limits`` and ``build_limits``: what the student's processes may use."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from grader.sandbox.limits import BUILD, BUILD_OUTPUT_BYTES, SandboxLimits
from grader.spec.quantity import Duration, Size
from grader.spec.source import Model

_DEFAULTS = SandboxLimits()

_Memory = Annotated[Size, Field(description="Memory of all processes together.")]
_Processes = Annotated[
    int,
    Field(
        ge=16,
        le=4096,
        description="Processes and threads together; a node of rclpy has 14 threads.",
    ),
]
_CpuTime = Annotated[Duration, Field(description="CPU time of all processes together.")]
_FileSize = Annotated[Size, Field(description="Size of one file.")]
_Disk = Annotated[
    Size, Field(description="Size of all written files together; they are kept in memory.")
]
_Files = Annotated[int, Field(ge=100, description="Number of created files and folders.")]
_Output = Annotated[
    Size, Field(description="Output to the terminal. A program that writes more is ended.")
]


class LimitOptions(Model):
    """Limits of the student's processes in a sandbox.

    Without a sandbox only time is limited. `discovery`, `timeout` and `shutdown` limit the time of
    a run.
    """

    _least_address_bytes: ClassVar[int] = _DEFAULTS.address_bytes

    memory: _Memory = _DEFAULTS.memory_bytes
    processes: _Processes = _DEFAULTS.processes
    cpu_time: _CpuTime = _DEFAULTS.cpu_s
    file_size: _FileSize = _DEFAULTS.file_bytes
    disk: _Disk = _DEFAULTS.disk_bytes
    files: _Files = _DEFAULTS.files
    output: _Output = _DEFAULTS.output_bytes

    def limits(self) -> SandboxLimits:
        """The same limits as the sandbox takes them."""
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


class BuildLimitOptions(LimitOptions):
    """Limits of the build of a submission: `setup.py` and `CMakeLists.txt` are programs too.

    Without a sandbox only `wall_time` and `output` are limited. A build that exceeds a limit fails.
    """

    _least_address_bytes: ClassVar[int] = BUILD.address_bytes

    memory: _Memory = BUILD.memory_bytes
    processes: _Processes = BUILD.processes
    cpu_time: _CpuTime = BUILD.cpu_s
    wall_time: Duration | None = Field(
        None,
        description="Time of the whole build, without that in which this machine gave it no CPU; "
        "by default 2 min if all packages are ament_python, else 5 min. A build that needs eight "
        "times as long because of the machine is repeated alone, and then not graded.",
    )
    file_size: _FileSize = BUILD.file_bytes
    disk: _Disk = BUILD.disk_bytes
    files: _Files = BUILD.files
    output: _Output = BUILD_OUTPUT_BYTES
