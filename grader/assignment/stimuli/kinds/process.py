"""The stimuli that end a process of the student, or start it again."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from grader.assignment.stimuli.stimulus_model import Preparation, StimulusModel, kind
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

    def prepared(self, preparation: Preparation) -> Kill:
        """The same with the name of the process, ``package/executable``."""
        process = preparation.process(self.key, self.kill, self.package)
        return self.model_copy(update={"kill": process})


@kind
class Restart(StimulusModel):
    """Start a process of the student again. If it still runs, it is ended first."""

    key = "restart"

    restart: str = Field(description="Name of the executable.")
    package: PackageName | None = Field(None, description="Its package, if several have it.")
    after: DurationOrZero = Field(description="When, counted from the first match.")

    def prepared(self, preparation: Preparation) -> Restart:
        """The same with the name of the process, ``package/executable``."""
        process = preparation.process(self.key, self.restart, self.package)
        return self.model_copy(update={"restart": process})
