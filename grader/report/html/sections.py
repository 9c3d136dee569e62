"""The sections of a report: the submission, what holds in several scenarios, each scenario."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from grader.assignment.model import Assignment, Scenario
from grader.checks.finding import Status
from grader.grade.model import Grade, total
from grader.recording.model import Recording
from grader.report.drawing.motion import draw_motion
from grader.report.drawing.path import draw_path
from grader.report.drawing.svg import Figure
from grader.report.drawing.timeline import draw_timeline
from grader.report.html.qos_table import Pair, pairs
from grader.report.model.result_model import CheckPart, FindingPart, Result
from grader.report.model.target import targets


@dataclass(frozen=True)
class Section:
    """Checks that belong together; those of one scenario, with its recording if there is one."""

    id: str
    title: str
    checks: tuple[CheckPart, ...]
    scenario: Scenario | None = None
    recording: Recording | None = None

    @property
    def points(self) -> float:
        """Points earned in it."""
        return total(check.points for check in self.checks)

    @property
    def max_points(self) -> float:
        """Points that it gives."""
        return total(check.max_points for check in self.checks)


@dataclass(frozen=True)
class Pictures:
    """What is shown of a run, and whether at once: something was lost, or a limit reached."""

    open: bool
    path: Figure | None
    motion: Figure | None
    timeline: Figure | None
    qos: tuple[Pair, ...]


def make_sections(
    grade: Grade, result: Result, recordings: Mapping[str, Recording]
) -> list[Section]:
    """Group the checks of a result; a section without anything to show is left out.

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
        sections.append(Section(f"run-{scenario.id}", title, of(scenario.id), scenario, recording))
    return [section for section in sections if section.checks or section.recording]


def draw_run(
    section: Section, result: Result, assignment: Assignment, *, alone: bool
) -> Pictures | None:
    """Draw what there is of a section's run, or None where it has none."""
    if section.scenario is None or section.recording is None:
        return None
    name, recording = section.scenario.id, section.recording
    findings = [
        finding for check in result.checks for finding in check.findings if finding.scenario == name
    ]
    lost = any(finding.status in (Status.FAILED, Status.ERROR) for finding in findings)
    return Pictures(
        alone or bool(recording.breaches) or lost,
        draw_path(recording, targets(assignment, name, recording.values), f"path-{name}"),
        draw_motion(recording, f"motion-{name}"),
        draw_timeline(recording, _moments(findings), f"line-{name}"),
        pairs(recording),
    )


def _moments(findings: Collection[FindingPart]) -> list[float]:
    """Times that findings which did not pass point at, in seconds since launch."""
    return [
        moment.time_s
        for finding in findings
        if finding.status is not Status.PASSED
        for moment in finding.evidence.moments
        if math.isfinite(moment.time_s)
    ]
