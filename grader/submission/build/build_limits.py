"""How much a build may take."""

from __future__ import annotations

from dataclasses import dataclass, field

from grader.sandbox.limits import BUILD, SandboxLimits
from grader.submission.build.bounded import OutputLimits
from grader.submission.intake.members import MIB


@dataclass(frozen=True)
class BuildLimits:
    """How much a build may take.

    Attributes:
        other_s: Wall time where one is not.
    """

    python_s: float = 120.0
    other_s: float = 300.0
    install_bytes: int = 512 * MIB
    install_files: int = 20_000
    output: OutputLimits = field(default_factory=OutputLimits)
    room: SandboxLimits = BUILD
