"""Why something that was expected is not there: one cause, the deepest that can be seen."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from grader.findings.finding import Evidence, Finding
from grader.spec.unit import format_duration


@dataclass(frozen=True)
class Cause:
    """The reason of a failure, in words that are the same in every check.

    Attributes:
        ours: The fault is not, or not certainly, the student's: the finding is an error.
        disturbed: The run should be repeated: the machine has, or may have, a part in it.
        concept: As that of a finding.
    """

    observed: str
    hint: str = ""
    evidence: Evidence = field(default_factory=Evidence)
    ours: bool = False
    disturbed: bool = False
    concept: str = ""

    @classmethod
    def to_repeat(cls, observed: str) -> Cause:
        """A cause in the machine or in rosgrade: the run should be repeated."""
        return cls(observed, ours=True, disturbed=True)

    @classmethod
    def held_up(cls, observed: str, stolen_s: float) -> Cause:
        """What may be so only because the machine took time from the process meanwhile."""
        took = f"the machine took up to {format_duration(stolen_s)} meanwhile"
        return cls.to_repeat(f"{observed}; {took}, which may explain it")

    def finding(self, expected: str) -> Finding:
        """The finding of a check that expected something else."""
        if self.ours:
            return Finding.error(expected, self.observed, disturbed=self.disturbed, hint=self.hint)
        found = Finding.failed(expected, self.observed, self.hint, self.evidence)
        return replace(found, disturbed=self.disturbed, concept=self.concept)

    def after(self, beginning: str) -> Cause:
        """The same cause with a text before it."""
        return replace(self, observed=f"{beginning}: {self.observed}")
