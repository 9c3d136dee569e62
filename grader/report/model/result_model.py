"""The model of ``result.json``, and with it its JSON Schema."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationInfo,
    computed_field,
    model_validator,
)
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from grader.findings.finding import Evidence, Status
from grader.grade.model import still_open, total
from grader.recording.submission import BuildRecord
from grader.spec.safe_text import encodable

SCHEMA: Literal[1] = 1


def normalized(value: Any) -> Any:
    """A value whose JSON gives the same value again: rounded, and encodable in UTF-8."""
    if isinstance(value, float):
        # Nine significant digits: microseconds in a run of minutes, and no noise behind.
        return float(f"{value:.9g}")
    if isinstance(value, str) and not isinstance(value, Enum):
        return encodable(value)
    if isinstance(value, tuple | list):
        return tuple(map(normalized, value))
    if isinstance(value, dict):
        return {normalized(name): normalized(item) for name, item in value.items()}
    if is_dataclass(value):
        return {one.name: normalized(getattr(value, one.name)) for one in fields(value)}
    return value


class ResultSchema(GenerateJsonSchema):
    """A schema in which a number may be one that JSON does not know, as text."""

    def float_schema(self, schema: core_schema.FloatSchema) -> JsonSchemaValue:
        """The schema of a number."""
        return {"anyOf": [{"type": "number"}, {"enum": ["NaN", "Infinity", "-Infinity"]}]}


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="strings")

    @model_validator(mode="before")
    @classmethod
    def _normal(cls, data: Any, info: ValidationInfo) -> Any:
        # What is read from a file was normal when it was written.
        return data if info.mode == "json" else normalized(data)


class Identity(_Part):
    """An assignment or a submission: its name, and the hash of its files."""

    id: str
    sha256: str


class AssignmentPart(Identity):
    """The assignment; ``location`` is its path where it is not one of rosgrade's own."""

    location: str | None = None


class SubmissionPart(Identity):
    """What was handed in; ``problem`` says why nothing of it could be read."""

    problem: str | None = None


class FindingPart(_Part):
    """A check's finding in one scenario, or about the submission (``scenario`` is null).

    ``concept`` is what ``rosgrade explain`` takes, or empty; ``asks`` says that it is a question,
    which of several things of the submission is meant.
    """

    scenario: str | None
    status: Status
    expected: str
    observed: str
    hint: str
    concept: str = ""
    disturbed: bool
    asks: bool = False
    traceback: str
    evidence: Evidence


class CheckPart(FindingPart):
    """A check: its finding in the scenario that decided, and in the others.

    ``waits_for`` names the checks to correct first where this one was skipped, ``author_hint``
    is the instructor's own hint to a check that did not pass, ``further_hints`` its next steps,
    ``cause`` the name that a person gave to the cause of a failure; only for instructors.
    """

    id: str
    title: str
    points: float
    max_points: float
    visibility: str
    author_hint: str
    waits_for: tuple[str, ...]
    other_scenarios: tuple[FindingPart, ...]
    further_hints: tuple[str, ...] = ()
    cause: str = ""

    @property
    def findings(self) -> tuple[FindingPart, ...]:
        """Its findings in every scenario, first in the one that decided."""
        return (self, *self.other_scenarios)


class WithheldPart(_Part):
    """Checks that the reader does not get to see yet; they are not in ``max_score`` either."""

    checks: int
    points: float


class DisturbancePart(_Part):
    """Delays of a run by the host: their sum, and the largest delay of the metronome."""

    taken_s: float
    worst_late_s: float


class ScenarioPart(_Part):
    """One run; ``recording`` is relative to the folder of the result.

    ``breaches`` are limits of the sandbox that were reached, ``remarks`` what else an instructor
    should know although it costs nothing by itself, ``runs`` how often it was run because the
    machine disturbed it.
    """

    id: str
    seed: int
    recording: str | None
    ending: str
    duration_s: float
    disturbance: DisturbancePart
    faults: tuple[str, ...]
    breaches: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    runs: int = 1

    @property
    def disturbed(self) -> bool:
        """Whether it was run again, or could not be used."""
        return self.runs > 1 or bool(self.faults)


class NamePart(_Part):
    """A name that the assignment leaves free: what was taken for it, and why."""

    name: str
    value: str
    why: str


class AdjustmentPart(_Part):
    """Points that no check gives: a person's, or those of a rule of the course.

    ``kind`` is ``manual`` (an item that a person scores), ``forgiven`` (points of a check, given
    back), ``given`` (to one student), ``late`` or ``attempts`` (rules of the course). ``points``
    are added, so a deduction is negative, and null where a manual item waits for a person;
    ``max_points`` is what a manual item can give, else 0. ``by`` are the initials of the person,
    empty for a rule; ``item`` is the id of the manual item, ``check`` that of the check that is
    forgiven, or that the points are about; ``instead`` says that they stand for it, as long as it
    could not be judged.
    """

    kind: Literal["manual", "forgiven", "given", "late", "attempts"]
    title: str
    points: float | None
    max_points: float = 0.0
    reason: str = ""
    by: str = ""
    check: str | None = None
    item: str | None = None
    instead: bool = False

    @property
    def is_of_counted(self) -> bool:
        """Whether a person gave them to the attempt that counts, and not in place of a check."""
        return self.kind == "manual" or (self.kind == "given" and not self.instead)


class CommentPart(_Part):
    """What a person wrote to the student, at a line of a file or about the whole.

    ``earlier`` says that it is about an attempt before this one, and its line is one of then.
    """

    text: str
    by: str
    file: str | None = None
    line: int | None = None
    earlier: bool = False


class AttemptPart(_Part):
    """One of the times that the student handed in, with its grade.

    ``handed_in`` is ISO 8601 with offset, or empty where it is not known; ``counts`` says whether
    the grade is that of this attempt; ``changes`` are what is different from the one before.
    ``visible`` is the same as far as the student may see it, where checks are hidden.
    """

    sha256: str
    handed_in: str
    score: float | None
    max_score: float
    counts: bool
    changes: tuple[str, ...] = ()
    visible: AttemptPart | None = None


class Result(_Part):
    """The whole of ``result.json``.

    ``score`` is that of the checks. It is null where ``graded`` is false, so that no gradebook can
    take the points of half a grade for a score. ``final_score`` is with the adjustments; it is
    null too while one of them waits for a person. ``hints_opened`` says how many of the further
    hints of a check were opened in the page of ``rosgrade watch``, by id; null if they are not
    counted.
    """

    schema_: Literal[1] = Field(alias="schema")
    rosgrade_version: str
    assignment: AssignmentPart
    submission: SubmissionPart
    score: float | None
    max_score: float
    graded: bool
    first_to_fix: str | None
    checks: tuple[CheckPart, ...]
    withheld: WithheldPart
    scenarios: tuple[ScenarioPart, ...]
    names: tuple[NamePart, ...] = ()
    build: BuildRecord | None
    environment: dict[str, str]
    started: str
    duration_s: float
    adjustments: tuple[AdjustmentPart, ...] = ()
    comments: tuple[CommentPart, ...] = ()
    attempts: tuple[AttemptPart, ...] = ()
    hints_opened: dict[str, int] | None = None

    model_config = ConfigDict(populate_by_name=True)

    @model_validator(mode="before")
    @classmethod
    def _without_sums(cls, data: Any) -> Any:
        sums = ("final_score", "final_max_score")
        known = isinstance(data, dict)
        return {name: data[name] for name in data if name not in sums} if known else data

    @computed_field  # type: ignore[prop-decorator]
    @property
    def final_score(self) -> float | None:
        """Points with the adjustments, at least 0; None while they are not complete."""
        waits = any(one.points is None for one in self.adjustments)
        return None if waits else self.known_score

    @computed_field  # type: ignore[prop-decorator]
    @property
    def final_max_score(self) -> float:
        """Points that can be had, with those that a person gives."""
        return total((self.max_score, *(one.max_points for one in self.adjustments)))

    @property
    def settled(self) -> frozenset[str | None]:
        """Checks that could not be judged, for which points of a person stand."""
        return frozenset(one.check for one in self.adjustments if one.instead)

    @property
    def open(self) -> tuple[CheckPart, ...]:
        """Checks with points without which there is no score: they could not be judged."""
        return () if self.graded else still_open(self.checks, self.settled)

    @property
    def known_score(self) -> float | None:
        """Points as far as they are known: without manual items that wait for a person."""
        points = (one.points for one in self.adjustments if one.points is not None)
        return max(0.0, total((self.score, *points))) if self.score is not None else None

    @property
    def known_max_score(self) -> float:
        """What :attr:`known_score` could be at most."""
        known = (one.max_points for one in self.adjustments if one.points is not None)
        return total((self.max_score, *known))

    @property
    def possible_score(self) -> float:
        """Points as far as they are known, with all that a person may still give."""
        waits = (one.max_points for one in self.adjustments if one.points is None)
        return total((self.known_score or 0.0, *waits))

    def of(self, status: Status) -> tuple[CheckPart, ...]:
        """Checks that ended so, in the author's order."""
        return tuple(check for check in self.checks if check.status is status)
