"""The model of a grade: the results of all checks of one submission, with points."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from decimal import ROUND_HALF_UP, Decimal
from typing import Any

from grader.assignment.load import LoadedAssignment
from grader.assignment.model import Assignment, Scenario, Visibility
from grader.findings.finding import Finding, Status
from grader.recording.submission import SubmissionRecord
from grader.spec.names import Names, Thing, WrongName

STEP = Decimal("0.01")
"""What partial credit is rounded to; sums are exact: 0.1 + 0.2 is 0.3."""

SEVERITY = (Status.ERROR, Status.FAILED, Status.SKIPPED, Status.PASSED)
"""Worst first: the status of a check is the worst of its findings."""


@dataclass(frozen=True)
class ScenarioFinding:
    """A finding and the scenario that it is about.

    Attributes:
        scenario: Its id; None for the submission itself, and for a check that was skipped.
        traceback: Where the check itself failed, for the instructor; else empty.
    """

    scenario: str | None
    finding: Finding
    traceback: str = ""


@dataclass(frozen=True)
class CheckResult:
    """The result of one check in all its scenarios.

    Attributes:
        points: Earned, in [0, max_points].
        scenarios: Ids of the scenarios that it judges; empty for the submission itself.
        findings: One per scenario in the assignment's order, at least one in all.
        credit: Share of the points in [0, 1].
        put_right: It failed alone, such as by a wrong name that the runs put right, so nothing
            waits for it.
        asked_name: What it asks for by its name, if anything.
    """

    id: str
    title: str
    status: Status
    points: float
    max_points: float
    visibility: Visibility
    scenarios: tuple[str, ...]
    findings: tuple[ScenarioFinding, ...]
    waits_for: tuple[str, ...] = ()
    hints: tuple[str, ...] = ()
    put_right: bool = False
    credit: float = 0.0
    asked_name: tuple[Thing, str] | None = None

    @property
    def decisive(self) -> ScenarioFinding:
        """The finding that decided: of this status, the first with the nearest credit."""
        return min(
            (item for item in self.findings if item.finding.status is self.status),
            key=lambda item: abs(item.finding.credit - self.credit),
        )


@dataclass(frozen=True)
class Chosen:
    """A free name, what a submission has in its place, and why that is taken for it."""

    name: str
    value: str
    why: str


@dataclass(frozen=True)
class Grade:
    """The grade of one submission.

    Attributes:
        loaded: The assignment, with the names that the submission chose.
        chosen: Those names, and why they are taken.
    """

    loaded: LoadedAssignment
    submission: SubmissionRecord
    results: tuple[CheckResult, ...]
    chosen: tuple[Chosen, ...] = ()

    @property
    def assignment(self) -> Assignment:
        """What the assignment says."""
        return self.loaded.assignment

    @property
    def graded(self) -> bool:
        """Whether every check with points could be judged. If not, the score means nothing yet."""
        return not still_open(self.results)

    @property
    def score(self) -> float:
        """Points earned by what could be judged."""
        return total(result.points for result in self.results)

    @property
    def max_score(self) -> float:
        """Points that the assignment gives."""
        return total(result.max_points for result in self.results)

    @property
    def full_points(self) -> bool:
        """Whether it is graded and no point was lost."""
        return self.graded and self.score == self.max_score

    def result(self, check: str) -> CheckResult:
        """The result of the check of that id."""
        return {result.id: result for result in self.results}[check]

    @property
    def names(self) -> dict[str, Names]:
        """Names to remap in the next run of each scenario.

        A name that is wrong in one scenario is remapped wherever one of its programs is launched.
        A topic that is wrong only because the name or the namespace of its node is, is left out: it
        follows its node.
        """
        programs: dict[str | None, set[tuple[str | None, str]]] = {
            scenario.id: {(launch.package, launch.program) for launch in scenario.launch}
            for scenario in self.assignment.scenarios
        }
        asked = {result.asked_name for result in self.results}
        found: list[tuple[WrongName, str | None]] = []
        untried: list[WrongName] = []
        for result in self.results:
            for item in result.findings:
                wrong = [w for w in item.finding.names.wrong if (w.thing, w.own) not in asked]
                found += [(name, item.scenario) for name in wrong]
                untried += [] if result.put_right else wrong

        def applies(name: WrongName, where: str | None, scenario: Scenario) -> bool:
            if where in programs and programs[where].isdisjoint(programs[scenario.id]):
                return False
            # A launch file says itself how its nodes and their topics are called.
            if name.rules and not any(launch.executable for launch in scenario.launch):
                return False
            return not any(other.explains(name) for other in untried)

        return {
            scenario.id: Names.of(name for name, where in found if applies(name, where, scenario))
            for scenario in self.assignment.scenarios
        }

    def disturbed_scenarios(self, status: Status) -> tuple[str, ...]:
        """Scenarios that are worth repeating alone, because the host disturbed them.

        Args:
            status: ``ERROR`` for those that could not be judged; ``FAILED`` for those where the
                host may have had a part in a failure.
        """
        disturbed = {
            item.scenario
            for result in self.results
            for item in result.findings
            if item.finding.status is status
            and item.finding.disturbed
            # What could not be judged in one scenario does not matter where the others decide.
            and not (status is Status.ERROR and result.status is not status)
        }
        return tuple(
            scenario.id for scenario in self.assignment.scenarios if scenario.id in disturbed
        )


def still_open(checks: Iterable[Any], settled: Collection[str | None] = ()) -> tuple[Any, ...]:
    """Checks with points that ended as an error, or wait for one that did.

    Args:
        settled: Ids of checks for which a person has given points: those are not open any more.
    """
    checks = tuple(checks)
    errors = {check.id for check in checks if check.status is Status.ERROR}
    return tuple(
        check
        for check in checks
        if check.max_points
        and check.id not in settled
        and not errors.isdisjoint((check.id, *check.waits_for))
    )


def points_for(max_points: float, credit: float) -> float:
    """Points of one check: the only place where points are rounded.

    A passed check has its full points, exactly as the author wrote them. Partial credit is
    rounded half up, and stays below, so that only what passes everything has the full score.

    Args:
        credit: Share in [0, 1]; only a passed check has 1.
    """
    if credit >= 1.0:
        return max_points
    full = _exact(max_points)
    earned = (full * _exact(credit)).quantize(STEP, ROUND_HALF_UP)
    return float(max(Decimal(0), min(earned, full - STEP)))


def total(points: Iterable[float]) -> float:
    """Sum without the errors of binary fractions."""
    return float(sum((_exact(value) for value in points), Decimal(0)))


def _exact(value: float) -> Decimal:
    return Decimal(repr(float(value)))
