"""The models of ``course.yaml``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema

from grader.course.instant import read_time, time_zone
from grader.spec.name import Id
from grader.spec.quantity import DurationOrZero, refusal
from grader.spec.source import Model
from grader.spec.unit import Dimension, parse_quantity, quantity_pattern


def _time(text: str) -> str:
    read_time(text)
    return text


def _deduction(value: object) -> object:
    """Points, or a percentage with its sign."""
    if isinstance(value, str):
        try:
            ratio = parse_quantity(value, Dimension.RATIO)
        except ValueError as error:
            raise refusal(str(error)) from None
        if "%" not in value or not 0.0 <= ratio <= 1.0:
            raise refusal(f"{value!r} is not a percentage from '0 %' to '100 %'")
    elif isinstance(value, bool) or not isinstance(value, int | float) or not value >= 0.0:
        raise refusal("expected points (0.5) or a percentage of all points ('10 %')")
    return value


Time = Annotated[
    str,
    AfterValidator(_time),
    WithJsonSchema({"type": "string", "pattern": r"^\d{4}-\d\d-\d\d[T ]\d\d:\d\d"}),
]
Zone = Annotated[str, AfterValidator(time_zone)]
_Percentage = WithJsonSchema({"type": "string", "pattern": quantity_pattern(Dimension.RATIO)})
Deduction = Annotated[float | Annotated[str, _Percentage], BeforeValidator(_deduction)]
Login = Annotated[str, Field(min_length=1)]
Unit = Literal["day", "hour"]


def points_of(deduction: float | str, max_score: float) -> float:
    """Points that a deduction is; a percentage is one of all points of the assignment."""
    if isinstance(deduction, str):
        return parse_quantity(deduction, Dimension.RATIO) * max_score
    return deduction


class Late(Model):
    """What lateness costs: so much for each day or hour that has begun."""

    per: Unit = Field(description="Each day or hour that has begun.")
    deduct: Deduction = Field(description="Points, or a percentage of all points.")
    grace: DurationOrZero = Field(0.0, description="Lateness that costs nothing.")
    at_most: Deduction | None = Field(None, description="The most that is deducted.")


class Tokens(Model):
    """Late tokens: each moves a due time of a student by a day or an hour."""

    each: int = Field(ge=1, description="Tokens of each student in the whole course.")
    worth: Unit = Field(description="What a token moves a due time by.")


class Attempts(Model):
    """Which attempt counts, where a student handed in several times."""

    counts: Literal["best", "last", "last before the deadline"] = Field(
        "last", description="The attempt that counts; best after deductions."
    )
    at_most: int | None = Field(None, ge=1, description="Later attempts do not count.")

    @property
    def words(self) -> str:
        """The rule in a few words."""
        return self.counts if self.at_most is None else f"{self.counts}, of at most {self.at_most}"


class AssignmentRules(Model):
    """The rules of one assignment; ``late`` and ``attempts`` instead of those of the course."""

    due: Time = Field(description="Until the end of this minute it is in time.")
    closes: Time | None = Field(None, description="Later ones count nothing.")
    published: Time | None = Field(None, description="Shows `after_published` from then on.")
    late: Late | None = None
    attempts: Attempts | None = None


class Extension(Model):
    """Another due time for one student."""

    student: Login
    assignment: Id
    due: Time | None = None
    days: int | None = Field(None, ge=1, le=1000)
    tokens: int | None = Field(None, ge=1, description="Late tokens that the student uses for it.")
    reason: str = Field("", description="For you; no report shows it.")


class CourseFile(Model):
    """The whole of ``course.yaml``."""

    rosgrade: Literal[1] = Field(1, description="Version of this format.")
    title: str
    time_zone: Zone | None = Field(None, description="IANA name, for times without an offset.")
    late: Late | None = None
    tokens: Tokens | None = None
    attempts: Attempts | None = None
    assignments: dict[Id, AssignmentRules] = Field(min_length=1)
    groups: tuple[tuple[Login, ...], ...] = Field((), description="Who hands in together.")
    extensions: tuple[Extension, ...] = ()
