"""Which message answers which question, where nothing in a message tells.

Answers come in the order of their questions, and after them; beyond that, they may come late,
twice, or not at all. A single missing answer must not shift all that follow, so answers are
aligned with questions as a whole: the pairing with the fewest wrong answers and unanswered
questions is taken, and of equal ones the one in which answers are the newest.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from collections.abc import Sequence
from statistics import median

import numpy as np
from numpy.typing import NDArray

# Being late costs next to nothing: of equal pairings the one is taken in which answers are the
# newest.
_LATE = 1e-4
_NEVER = np.inf


def pair(
    asked_ns: Sequence[int],
    answered_ns: Sequence[int],
    right: NDArray[np.bool_],
    optional: Sequence[bool],
) -> tuple[int | None, ...]:
    """The index of its question for each answer; None for what came before the first question.

    Args:
        right: Whether an answer would be right for a question, shape (questions, answers).
    """
    if not len(asked_ns) or not answered_ns or answered_ns[-1] < asked_ns[0]:
        return (None,) * len(answered_ns)
    arguments = asked_ns, answered_ns, right, optional
    found = _align(*arguments, wrong=1.0, copy=0.0)
    counts = Counter(question for question in found if question is not None)
    if median(counts.values()) >= 2:
        # A node that says everything twice is late with a copy now and then.
        return _align(*arguments, wrong=1.5, copy=0.0)
    # From another one, the answer before once more is its answer to the newest question.
    return _align(*arguments, wrong=1.0, copy=2.0)


def _align(
    asked_ns: Sequence[int],
    answered_ns: Sequence[int],
    right: NDArray[np.bool_],
    optional: Sequence[bool],
    *,
    wrong: float,
    copy: float,
) -> tuple[int | None, ...]:
    """The cheapest pairing; at least one answer is not before the first question.

    Args:
        wrong: Cost of a wrong answer; a question without an answer costs 1.
        copy: Cost of an answer once more, after a question that needs none.
    """
    questions = len(asked_ns)
    newest = [bisect_right(asked_ns, time) - 1 for time in answered_ns]
    early = sum(index < 0 for index in newest)
    # needed[j]: questions before j that must be answered.
    needed = np.concatenate(([0.0], np.cumsum(~np.asarray(optional, dtype=bool))))
    # Cost of the best pairing so far in which the last answer belongs to question j.
    cost = needed[:-1].copy()
    origins = np.zeros((len(newest), questions), dtype=np.int32)
    for answer in range(early, len(newest)):
        here = wrong * ~right[:, answer] + _LATE * (newest[answer] - np.arange(questions))
        here[newest[answer] + 1 :] = _NEVER
        if answer == early:
            cost = cost + here
            continue
        moved, origin = _move(cost, needed)
        again = cost.copy()
        if optional[newest[answer]]:
            again[: newest[answer]] += copy
        stays = again <= moved
        origins[answer] = np.where(stays, np.arange(questions), origin)
        cost = np.where(stays, again, moved) + here
    last = int(np.argmin(cost + needed[-1] - needed[1:]))
    found: list[int | None] = [None] * len(newest)
    for answer in range(len(newest) - 1, early - 1, -1):
        found[answer] = last
        last = int(origins[answer, last])
    return tuple(found)


def _move(
    cost: NDArray[np.float64], needed: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Cheapest way to each question from one before it, and from which."""
    questions = len(cost)
    free = cost - needed[1:]
    best = np.minimum.accumulate(free)
    # The index of the newest question that has the lowest cost so far.
    is_best = free <= best
    index = np.maximum.accumulate(np.where(is_best, np.arange(questions), 0))
    moved = np.full(questions, _NEVER)
    origin = np.zeros(questions, dtype=np.int32)
    moved[1:] = best[:-1] + needed[1:-1]
    origin[1:] = index[:-1]
    return moved, origin
