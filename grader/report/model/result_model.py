"""The model of ``result.json``, and with it its JSON Schema."""

from __future__ import annotations

import math
from collections.abc import Hashable
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    PlainSerializer,
    WithJsonSchema,
)

from grader.checks.finding import Status
from grader.grade.first import reason
from grader.safe_text import encodable

SCHEMA: Literal[1] = 1


def _rounded(value: float) -> float:
    """Nine significant digits: microseconds in a run of minutes, and no noise behind."""
    return float(f"{value:.9g}")


def _json_number(value: float) -> float | str:
    if math.isfinite(value):
        return value
    return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"


def _encodable(value: Any) -> Any:
    return encodable(value) if isinstance(value, str) else value


Text = Annotated[str, BeforeValidator(_encodable)]
Number = Annotated[
    float,
    AfterValidator(_rounded),
    PlainSerializer(_json_number),
    WithJsonSchema(
        {"anyOf": [{"type": "number"}, {"enum": ["NaN", "Infinity", "-Infinity"]}]},
    ),
]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Identity(_Part):
    """An assignment or a submission: its name, and the hash of its files."""

    id: Text
    sha256: Text


class AssignmentPart(Identity):
    """The assignment; ``location`` is its path where it is not one of rosgrade's own."""

    location: Text | None = None


class SubmissionPart(Identity):
    """What was handed in; ``problem`` says why nothing of it could be read."""

    problem: Text | None = None


class PlacePart(_Part):
    """A place in the student's files."""

    file: Text
    line: int | None
    message: Text


class MomentPart(_Part):
    """A time in the recording, in seconds since launch."""

    label: Text
    time_s: Number


class PlotPart(_Part):
    """Values to draw; the labels name the units."""

    title: Text
    x_label: Text
    y_label: Text
    x: tuple[Number, ...]
    y: tuple[Number, ...]
    band: tuple[Number, Number] | None
    histogram: bool = False


class TablePart(_Part):
    """Rows to show."""

    title: Text
    header: tuple[Text, ...]
    rows: tuple[tuple[Text, ...], ...]


class SpanPart(_Part):
    """Something that lasted, in seconds since launch."""

    name: Text
    begin_s: Number
    end_s: Number
    wrong: bool


class CasePart(_Part):
    """One case that was tried; ``error`` is null where no answer came."""

    name: Text
    group: Text
    error: Number | None


class CasesPart(_Part):
    """Errors of many cases; the label names their unit and that of the limit."""

    title: Text
    label: Text
    limit: Number
    cases: tuple[CasePart, ...]


class ComparisonPart(_Part):
    """Two texts side by side, line by line."""

    title: Text
    expected: tuple[Text, ...]
    observed: tuple[Text, ...]


class EvidencePart(_Part):
    """Where a finding can be seen."""

    moments: tuple[MomentPart, ...]
    places: tuple[PlacePart, ...]
    log: tuple[Text, ...]
    plots: tuple[PlotPart, ...]
    tables: tuple[TablePart, ...]
    spans: tuple[SpanPart, ...] = ()
    cases: tuple[CasesPart, ...] = ()
    comparisons: tuple[ComparisonPart, ...] = ()


class FindingPart(_Part):
    """What a check said of one scenario, or of the submission (``scenario`` is null)."""

    scenario: Text | None
    status: Status
    expected: Text
    observed: Text
    hint: Text
    disturbed: bool
    traceback: Text
    evidence: EvidencePart


class CheckPart(FindingPart):
    """A check: what it said of the scenario that decided, and of the others.

    ``waits_for`` names the checks to correct first where this one was skipped, ``author_hint``
    is the instructor's own hint to a check that did not pass.
    """

    id: Text
    title: Text
    points: Number
    max_points: Number
    visibility: Text
    author_hint: Text
    waits_for: tuple[Text, ...]
    other_scenarios: tuple[FindingPart, ...]

    @property
    def findings(self) -> tuple[FindingPart, ...]:
        """What it said of every scenario, first of the one that decided."""
        return (self, *self.other_scenarios)


class WithheldPart(_Part):
    """Checks that the reader does not get to see yet; they are not in ``max_score`` either."""

    checks: int
    points: Number


class DisturbancePart(_Part):
    """What the host took from a run: in all, and the latest that a clock of ours woke up."""

    taken_s: Number
    worst_late_s: Number


class ScenarioPart(_Part):
    """One run; ``recording`` is relative to the folder of the result.

    ``breaches`` are limits of the sandbox that were reached, ``remarks`` what else an instructor
    should know although it costs nothing by itself, ``runs`` how often it was run because the
    machine disturbed it.
    """

    id: Text
    seed: int
    recording: Text | None
    ending: Text
    duration_s: Number
    disturbance: DisturbancePart
    faults: tuple[Text, ...]
    breaches: tuple[Text, ...] = ()
    remarks: tuple[Text, ...] = ()
    runs: int = 1

    @property
    def disturbed(self) -> bool:
        """Whether it was run again, or could not be used."""
        return self.runs > 1 or bool(self.faults)


class BuildPart(_Part):
    """What ``colcon build`` did."""

    succeeded: bool
    duration_s: Number
    cached: bool
    timed_out: bool
    failed_packages: tuple[Text, ...]
    lacking: tuple[Text, ...] = ()
    culprit: PlacePart | None
    log: Text


class Result(_Part):
    """The whole of ``result.json``.

    ``score`` is null where ``graded`` is false, so that no gradebook can take the points of
    half a grade for a score.
    """

    schema_: Literal[1]
    rosgrade_version: Text
    assignment: AssignmentPart
    submission: SubmissionPart
    score: Number | None
    max_score: Number
    graded: bool
    first_to_fix: Text | None
    checks: tuple[CheckPart, ...]
    withheld: WithheldPart
    scenarios: tuple[ScenarioPart, ...]
    build: BuildPart | None
    environment: dict[Text, Text]
    started: Text
    duration_s: Number

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        alias_generator=lambda name: name.rstrip("_"),
        populate_by_name=True,
    )

    def of(self, status: Status) -> tuple[CheckPart, ...]:
        """Checks that ended so, in the author's order."""
        return tuple(check for check in self.checks if check.status is status)

    @property
    def reasons(self) -> dict[str, Hashable]:
        """Why each failed check failed, by id: equal for those that name the same mistake."""
        return {
            check.id: reason(check.id, check.scenario, check.observed, check.evidence)
            for check in self.of(Status.FAILED)
        }
