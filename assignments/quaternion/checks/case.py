"""Cases of a conversion: the question, its answers, and how far off they are."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from grader.findings.value import number_at
from grader.findings.value import NoSuchField
from grader.recording.model import NS, Message

from .conversion import (
    CONVERSIONS,
    Group,
    Rows,
    WrongMessage,
    angles_between,
    oracle,
    rotations_of_answers,
)
from .pairing import pair


@dataclass(frozen=True)
class CaseLimits:
    """How far a rotation may be off, and the length of a quaternion from 1."""

    angle_rad: float
    length: float


@dataclass(frozen=True)
class Answer:
    """One answer to a question: its angle to the right rotation, and a quaternion's length."""

    row: tuple[float, ...]
    error_rad: float
    length: float | None
    good: bool

    @property
    def finite(self) -> bool:
        """Whether each of its numbers is one."""
        return all(map(math.isfinite, self.row))


@dataclass(frozen=True)
class Case:
    """A question with its answers.

    Attributes:
        right: Unit quaternion (x, y, z, w) of the right rotation.
        answers: The worst first; none if nothing answers it.
        behind_s: Where the next question had been sent already when the first answer came: how
            long ago the newest question was sent then; else None.
    """

    number: int
    row: tuple[float, ...]
    group: Group
    right: tuple[float, ...]
    asked_ns: int
    answers: tuple[Answer, ...]
    behind_s: float | None

    @property
    def good(self) -> bool:
        """Whether every answer is right; without one, whether none is needed."""
        return all(answer.good for answer in self.answers) and (bool(self.answers) or self.optional)

    @property
    def optional(self) -> bool:
        """Whether no answer is right, too."""
        return self.group is Group.ZERO


def rows(messages: Sequence[Message], paths: Sequence[str]) -> Rows:
    """The numbers of messages, shape (n, number of paths).

    Raises:
        WrongMessage: A message has no such field.
    """
    try:
        found = [[number_at(message.value, path) for path in paths] for message in messages]
    except NoSuchField as error:
        raise WrongMessage(f"{messages[0].topic}: {error}") from error
    return np.array(found, dtype=np.float64).reshape(len(messages), len(paths))


def cases(
    conversion: str, sent: Sequence[Message], received: Sequence[Message], limits: CaseLimits
) -> tuple[Case, ...]:
    """Pair answers with questions and measure them.

    Raises:
        WrongMessage: A message is not of the conversion.
    """
    kind = CONVERSIONS[conversion]
    questions, answers = rows(sent, kind.asks), rows(received, kind.answers)
    if not np.isfinite(questions).all():
        raise WrongMessage(f"{sent[0].topic}: a question is not finite")
    right = oracle(conversion, questions)
    groups = [kind.group(row) for row in questions.tolist()]
    error, lengths = _measure(right, answers)
    good = (error <= limits.angle_rad) & (
        np.abs(np.nan_to_num(lengths, nan=1.0) - 1.0) <= limits.length
    )
    asked_ns = [message.stamp_ns for message in sent]
    answered_ns = [message.stamp_ns for message in received]
    paired = pair(asked_ns, answered_ns, good, [group is Group.ZERO for group in groups])
    found: list[list[int]] = [[] for _ in sent]
    for answer, question in enumerate(paired):
        if question is not None:
            found[question].append(answer)
    return tuple(
        Case(
            number=index + 1,
            row=tuple(questions[index].tolist()),
            group=groups[index],
            right=tuple(right[index].tolist()),
            asked_ns=asked_ns[index],
            answers=tuple(
                sorted(
                    (
                        Answer(
                            tuple(answers[one].tolist()),
                            float(error[index, one]),
                            None if math.isnan(lengths[one]) else float(lengths[one]),
                            bool(good[index, one]),
                        )
                        for one in found[index]
                    ),
                    key=lambda item: (item.good, -item.error_rad),
                )
            ),
            behind_s=_behind_s(asked_ns, index, [answered_ns[one] for one in found[index]]),
        )
        for index in range(len(sent))
    )


def _behind_s(asked_ns: list[int], index: int, answered_ns: list[int]) -> float | None:
    if not answered_ns:
        return None
    newest = bisect_right(asked_ns, answered_ns[0]) - 1
    return (answered_ns[0] - asked_ns[newest]) / NS if newest > index else None


def _measure(right: Rows, answers: Rows) -> tuple[Rows, Rows]:
    """Errors in radians, shape (questions, answers), and lengths, NaN where there is none."""
    usable = np.isfinite(answers).all(axis=1)
    lengths = np.full(len(answers), np.nan)
    if answers.shape[1] == 4:
        with np.errstate(over="ignore"):
            norms = np.linalg.norm(answers, axis=1)
        lengths[usable] = norms[usable]
        # A quaternion of zeros is no rotation.
        usable = usable & (norms > 0.0) & np.isfinite(norms)
    error = np.full((len(right), len(answers)), np.inf)
    if usable.any():
        error[:, usable] = angles_between(right, rotations_of_answers(answers[usable]))
    return error, lengths
