"""The models of the review files: ``OUT/review/<student>.yaml`` and ``OUT/review/class.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from grader.spec.name import Id
from grader.spec.source import Model

Initials = Annotated[str, Field(min_length=1, max_length=40, description="Who wrote it.")]
Text = Annotated[str, Field(min_length=1, max_length=20_000)]


class ManualScore(Model):
    """Points that a person gave for a manual item."""

    points: float = Field(ge=0)
    by: Initials
    note: str = Field("", description="Why, for the student.")


class Comment(Model):
    """What a person wrote to the student, at a line of a file or about the whole."""

    text: Text
    by: Initials
    file: str | None = Field(None, description="Relative to what was handed in.")
    line: int | None = Field(None, ge=1)


class StudentReview(Model):
    """The review of one student, or of a team under the key of its first member."""

    key: str = Field(min_length=1, description="As in the column `submission` of grades.csv.")
    manual: dict[Id, ManualScore] = Field(default_factory=dict, description="By manual item.")
    comments: tuple[Comment, ...] = ()
    notes: str = Field("", description="Of an oral exam, say; only for instructors.")


class BankEntry(Model):
    """A comment that is used again and again."""

    text: Text
    used: int = Field(0, ge=0, description="How often.")


class Forgiven(Model):
    """A cause of failures that costs the class nothing, or less."""

    check: Id = Field(description="Id of the check that failed.")
    cause: str = Field(min_length=1, description="As the cluster names it.")
    share: float = Field(1.0, gt=0.0, le=1.0, description="Of the lost points, to give back.")
    reason: str = Field("", description="Why, for the student.")
    by: Initials


class ClassReview(Model):
    """What is written about the whole class."""

    bank: tuple[BankEntry, ...] = Field((), description="The bank of comments.")
    forgiven: tuple[Forgiven, ...] = ()

    @property
    def shares(self) -> dict[tuple[str, str], float]:
        """Check and cause of each cluster that is forgiven -> share of the lost points."""
        return {(one.check, one.cause): one.share for one in self.forgiven}
