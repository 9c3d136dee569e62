"""The stimuli that end a process of the student, or start it again."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from grader.assignment.stimuli.stimulus_model import Making, StimulusModel, kind
from grader.spec.name import PackageName
from grader.spec.quantity import DurationOrZero

Signal = Literal["SIGINT", "SIGTERM", "SIGKILL"]


@kind
class Kill(StimulusModel):
    """Send a signal to a process of the student."""

    key = "kill"

    kill: str = Field(description="Name of the executable.")
    package: PackageName | None = Field(None, description="Its package, if several have it.")
    after: DurationOrZero = Field(description="When, counted from the first match.")
    signal: Signal = Field("SIGINT", description="The signal: SIGINT is Ctrl-C.")

    def order(self, making: Making) -> dict[str, Any]:
        """The signal."""
        process = making.process(self.key, self.kill, self.package)
        signal, after_s = self.signal, self.after
        return {"kind": "KillOrder", "process": process, "signal": signal, "after_s": after_s}


@kind
class Restart(StimulusModel):
    """Start a process of the student again. If it still runs, it is ended first."""

    key = "restart"

    restart: str = Field(description="Name of the executable.")
    package: PackageName | None = Field(None, description="Its package, if several have it.")
    after: DurationOrZero = Field(description="When, counted from the first match.")

    def order(self, making: Making) -> dict[str, Any]:
        """The process."""
        process = making.process(self.key, self.restart, self.package)
        return {"kind": "RestartOrder", "process": process, "after_s": self.after}
