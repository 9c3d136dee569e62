"""The models of the review files: ``OUT/review/<student>.yaml`` and ``OUT/review/class.yaml``."""

from __future__ import annotations

from collections.abc import Collection
from typing import Annotated, Any

from pydantic import Field

from grader.spec.name import Id
from grader.spec.source import Model

Initials = Annotated[str, Field(min_length=1, max_length=40, description="Who wrote it.")]
Text = Annotated[str, Field(min_length=1, max_length=20_000)]
_LONG_ENOUGH = 16
"""Characters of a hash that tell the attempts of a student apart."""


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


class Given(Model):
    """Points that a person gives to one student, or takes away."""

    points: float = Field(description="They are added.")
    reason: Text
    by: Initials
    check: Id | None = Field(None, description="The check that they are about, if any.")
    instead: bool = Field(
        False, description="Only as long as the check could not be judged: they stand for it."
    )


class AttemptReview(Model):
    """What is written about one attempt of a student."""

    attempt: str = Field("", description="How its hash begins; empty for every attempt.")
    manual: dict[Id, ManualScore] = Field(default_factory=dict, description="By manual item.")
    comments: tuple[Comment, ...] = ()
    given: tuple[Given, ...] = ()
    causes: dict[Id, Annotated[str, Field(min_length=1, max_length=200)]] = Field(
        default_factory=dict, description="By failed check: its cause, named by a person."
    )


class StudentReview(AttemptReview):
    """The review of one student, or of a team under the key of one of them."""

    key: str = Field(min_length=1, description="As in the column `submission` of grades.csv.")
    notes: str = Field("", description="Of an oral exam, say; only for instructors.")
    others: tuple[AttemptReview, ...] = Field((), description="About other attempts.")

    def of(self, attempt: str) -> AttemptReview:
        """What is written about an attempt, by its hash."""
        # What is about every attempt counts only where nothing is about this one.
        reviews = sorted((self, *self.others), key=lambda review: not review.attempt)
        fitting = (review for review in reviews if attempt.startswith(review.attempt))
        return next(fitting, AttemptReview())

    def others_than(self, shown: AttemptReview, before: Collection[str]) -> list[AttemptReview]:
        """What is written about the attempts before, by their hashes, first to last."""
        reviews: list[AttemptReview] = []
        for review in map(self.of, before):
            is_known = any(review is other for other in (shown, *reviews))
            if review.attempt and _is_written(review) and not is_known:
                reviews.append(review)
        others = []
        for review in reviews:
            # What was about every attempt is in each that something was written about since.
            comments = [one for one in review.comments if one not in shown.comments]
            others.append(review.model_copy(update={"comments": tuple(comments)}))
        return others

    def about(self, attempt: str, **update: object) -> StudentReview:
        """The review with another text about one attempt; what is about others stays beside it."""
        before = self.of(attempt)
        changed = AttemptReview(**_content(before) | {"attempt": attempt[:_LONG_ENOUGH]} | update)
        # What is about every attempt stays so for the others.
        others = tuple(one for one in self.others if one is not before or not one.attempt)
        if any(one is before for one in self.others):
            return self.model_copy(update={"others": (*others, changed)})
        is_about_others = before is not self or not self.attempt
        if is_about_others and _is_written(self):
            others = (*others, AttemptReview(**_content(self)))
        return self.model_copy(update={**dict(changed), "others": others})


def _is_written(review: AttemptReview) -> bool:
    """Whether something is written down about an attempt."""
    return len(_content(review)) > 1


def _content(review: AttemptReview) -> dict[str, Any]:
    """What is written down about one attempt."""
    names = AttemptReview.model_fields
    return {name: value for name, value in review if name in names and (value or name == "attempt")}


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
