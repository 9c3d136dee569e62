"""Assignments and recordings made by hand, with checks whose findings the test gives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from grader.assignment.binding import BoundCheck
from grader.assignment.load import LoadedAssignment
from grader.assignment.model import Assignment, CheckSpec, Launch, Package, Scenario
from grader.checks.check import Check, NoParameters, Parameters, Subject
from grader.findings.finding import Finding
from grader.recording.model import NS, Ending, Process, Recording
from grader.recording.submission import BuildRecord, PackageRecord, SubmissionRecord

LAUNCHED_NS = 1_760_000_000 * NS
PASS = Finding.passed("a node /bot_publisher", "/bot_publisher")
FAIL = Finding.failed("a node /bot_publisher", "no node at all", "Call rclpy.spin(node).")


@dataclass(frozen=True)
class Told:
    """A check whose findings the test gives.

    Attributes:
        says: A finding, a finding for each scenario, an exception to raise, or anything else.
        asked: Collects what it was asked to judge.
    """

    id: str
    says: Any = PASS
    subject: Subject = Subject.RECORDING
    requires: tuple[str, ...] = ()
    points: float = 1.0
    scenarios: tuple[str, ...] = ()
    title: str = ""
    hint: str | Sequence[str | dict[str, str]] = ""
    visibility: str = "visible"
    counts: str = "worst"
    uses: str = "told.told"
    parameters: Parameters = field(default_factory=NoParameters)
    asked: list[Any] = field(default_factory=list, compare=False)

    def bound(self) -> BoundCheck:
        spec = CheckSpec.model_validate(
            {
                "id": self.id,
                "title": self.title or f"Title of {self.id}",
                "uses": self.uses,
                "points": self.points,
                "requires": self.requires,
                "scenarios": self.scenarios,
                "hint": self.hint,
                "visibility": self.visibility,
                "counts": self.counts,
            }
        )
        check = Check(self.uses, self.subject, NoParameters, self._judge)
        return BoundCheck(spec, check, self.parameters)

    def _judge(self, subject: Any, parameters: Parameters) -> Any:
        self.asked.append(subject)
        says = self.says[subject.scenario] if isinstance(self.says, dict) else self.says
        if isinstance(says, Exception):
            raise says
        return says() if callable(says) else says


def make_loaded(
    checks: Sequence[Told],
    scenarios: Sequence[str] = ("listen",),
    titles: Mapping[str, str] | None = None,
    title: str = "Publish a Twist every 300 ms",
    launched: str = "bot_publisher",
) -> LoadedAssignment:
    bound = tuple(check.bound() for check in checks)
    assignment = Assignment(
        rosgrade=1,
        id="timed_publisher",
        title=title,
        packages=(Package(name="bot_publisher"),),
        scenarios=tuple(
            Scenario(
                id=name,
                title=(titles or {}).get(name, ""),
                launch=(Launch(package=launched, executable="bot_pub"),),
                timeout="10 s",
            )
            for name in scenarios
        ),
        checks=tuple(check.spec for check in bound),
    )
    return LoadedAssignment(assignment, Path("timed_publisher/assignment.yaml"), "ab" * 32, bound)


def make_submission(**changes: Any) -> SubmissionRecord:
    facts: dict[str, Any] = {
        "id": "ada_lovelace",
        "sha256": "cd" * 32,
        "packages": (PackageRecord("bot_publisher", "src/bot_publisher"),),
        "build": BuildRecord(succeeded=True, duration_s=1.3),
    }
    return SubmissionRecord(**(facts | changes))


def make_recording(scenario: str = "listen", **changes: Any) -> Recording:
    facts: dict[str, Any] = {
        "seed": 7,
        "ending": Ending.UNTIL,
        "launched_ns": LAUNCHED_NS,
        "stop_ns": LAUNCHED_NS + 4 * NS,
        "end_ns": LAUNCHED_NS + 5 * NS,
        "submission": make_submission(),
        "processes": (
            Process("bot_publisher/bot_pub", 4711, LAUNCHED_NS, LAUNCHED_NS + 5 * NS, 0, "SIGINT"),
        ),
    }
    return Recording(scenario=scenario, **(facts | changes))
