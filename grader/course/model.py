"""The models of ``course.yaml``."""

from __future__ import annotations

from typing import Annotated, Any, Literal

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


def course_schema() -> dict[str, Any]:
    """The JSON Schema of ``course.yaml``, for editors."""
    draft = "https://json-schema.org/draft/2020-12/schema"
    return {"$schema": draft, **CourseFile.model_json_schema()}


Time = Annotated[
    str,
    AfterValidator(_time),
    WithJsonSchema({"type": "string", "pattern": r"^\d{4}-\d\d-\d\d[T ]\d\d:\d\d"}),
]
Zone = Annotated[str, AfterValidator(time_zone)]
Percentage = WithJsonSchema({"type": "string", "pattern": quantity_pattern(Dimension.RATIO)})
Deduction = Annotated[
    float | Annotated[str, Percentage],
    BeforeValidator(_deduction),
]
Login = Annotated[str, Field(min_length=1)]


def points_of(deduction: float | str, max_score: float) -> float:
    """Points that a deduction is; a percentage is one of all points of the assignment."""
    if isinstance(deduction, str):
        return parse_quantity(deduction, Dimension.RATIO) * max_score
    return deduction


class Late(Model):
    """What lateness costs: so much for each day or hour that has begun."""

    per: Annotated[Literal["day", "hour"], Field(description="Each day or hour that has begun.")]
    deduct: Annotated[Deduction, Field(description="Points, or a percentage of all points.")]
    grace: Annotated[DurationOrZero, Field(description="Lateness that costs nothing.")] = 0.0
    at_most: Annotated[Deduction | None, Field(description="The most that is deducted.")] = None


class Tokens(Model):
    """Late tokens: each moves a due time of a student by a day or an hour."""

    each: Annotated[int, Field(ge=1, description="Tokens of each student in the whole course.")]
    worth: Annotated[Literal["day", "hour"], Field(description="What a token moves it by.")]


class Attempts(Model):
    """Which attempt counts, where a student handed in several times."""

    counts: Annotated[
        Literal["best", "last", "last before the deadline"],
        Field(description="The attempt that counts; best after deductions."),
    ] = "last"
    at_most: Annotated[int | None, Field(ge=1, description="Later attempts do not count.")] = None

    @property
    def words(self) -> str:
        """The rule in a few words."""
        return self.counts if self.at_most is None else f"{self.counts}, of at most {self.at_most}"


class AssignmentRules(Model):
    """The rules of one assignment; ``late`` and ``attempts`` instead of those of the course."""

    due: Annotated[Time, Field(description="Until the end of this minute it is in time.")]
    closes: Annotated[Time | None, Field(description="Later ones count nothing.")] = None
    published: Annotated[
        Time | None, Field(description="From then on students see `after_published` checks.")
    ] = None
    late: Late | None = None
    attempts: Attempts | None = None
    results: Annotated[
        str | None,
        Field(description="Folder of its batch, beside this file; late tokens are counted there."),
    ] = None


class Extension(Model):
    """Another due time for one student."""

    student: Login
    assignment: Id
    due: Time | None = None
    days: Annotated[int | None, Field(ge=1)] = None
    reason: Annotated[str, Field(description="For you; no report shows it.")] = ""


class CourseFile(Model):
    """The whole of ``course.yaml``."""

    title: str
    time_zone: Annotated[
        Zone | None, Field(description="IANA name; times without an offset are in it.")
    ] = None
    late: Late | None = None
    tokens: Tokens | None = None
    attempts: Attempts | None = None
    assignments: Annotated[dict[Id, AssignmentRules], Field(min_length=1)]
    groups: Annotated[
        tuple[tuple[Login, ...], ...] | str | None,
        Field(description="Who hands in together: lists of students, or a column of the roster."),
    ] = None
    extensions: tuple[Extension, ...] = ()
