"""The sections of a report: the submission, what holds in several scenarios, each scenario."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from grader.assignment.model import Scenario
from grader.findings.finding import Status
from grader.grade.model import Grade
from grader.recording.model import Recording
from grader.report.model.result_model import CheckPart, FindingPart, Result


@dataclass(frozen=True)
class Section:
    """Checks that belong together; of a scenario with its recording and all its findings."""

    id: str
    title: str
    checks: tuple[CheckPart, ...]
    scenario: Scenario | None = None
    recording: Recording | None = None
    findings: tuple[FindingPart, ...] = ()

    @property
    def lost(self) -> bool:
        """Whether something was lost in the run, or a limit reached."""
        reached = self.recording is not None and bool(self.recording.breaches)
        return reached or any(
            finding.status in (Status.FAILED, Status.ERROR) for finding in self.findings
        )

    @property
    def moments_s(self) -> list[float]:
        """Times that findings which did not pass point at, in seconds since launch."""
        return [
            moment.time_s
            for finding in self.findings
            if finding.status is not Status.PASSED
            for moment in finding.evidence.moments
            if math.isfinite(moment.time_s)
        ]


def make_sections(
    grade: Grade, result: Result, recordings: Mapping[str, Recording]
) -> list[Section]:
    """Group the checks of a result; sections in which all passed come last.

    A section without anything to show is left out.

    Args:
        grade: The whole grade; of checks that are not in the result nothing is shown.
    """
    judge = {one.id: one.scenarios for one in grade.results}
    is_copy = len(result.checks) < len(grade.results)
    seen = {name for check in result.checks for name in judge[check.id]}

    def of(*scenarios: str) -> tuple[CheckPart, ...]:
        return tuple(check for check in result.checks if judge[check.id] == scenarios)

    several = tuple(check for check in result.checks if len(judge[check.id]) > 1)
    sections = [
        Section("submission", "The submission", of()),
        Section("several", "In several scenarios", several),
    ]
    for scenario in grade.assignment.scenarios:
        title = scenario.title.rstrip(".") or f"Scenario {scenario.id}"
        # What no visible check judges, a student does not get to see.
        recording = None if is_copy and scenario.id not in seen else recordings.get(scenario.id)
        found = tuple(
            finding
            for check in result.checks
            for finding in check.findings
            if finding.scenario == scenario.id
        )
        checks = of(scenario.id)
        sections.append(Section(f"run-{scenario.id}", title, checks, scenario, recording, found))
    shown = [section for section in sections if section.checks or section.recording]
    return sorted(
        shown,
        key=lambda one: not one.lost and all(c.status is Status.PASSED for c in one.checks),
    )
