"""Answers to questions, matched one by one: a node may answer twice, late or not at all."""

from __future__ import annotations

_COPY_S = 0.05
"""Copies of an answer come within this time of it."""
_LONGER = 2.0
"""An answer that is the same as the one before may be a copy of it: the true one may take so many
times longer than any before it did."""


class Answers:
    """Counts the answers on a topic, while one question after another is published.

    A second answer to one question must not pass for the answer to the next: the questions would
    run ahead of the node, which would then lose some of them, or be ended before its last answer.
    """

    def __init__(self, within_s: float) -> None:
        self._within_s = within_s
        self._newest: bytes | None = None
        self._newest_before_question: bytes | None = None
        self._is_asked = False
        self._first_answer_s: float | None = None
        """When the first answer to this question came, or what may be a copy of the one before."""
        self._is_answered = False
        """Whether an answer came that is not a copy of the one before."""
        self._is_behind = False
        """Whether an answer to an earlier question may still come."""
        self._slowest_s = 0.0

    def ask(self) -> None:
        """Note that a question is published."""
        if self._is_asked and self._first_answer_s is None:
            self._is_behind = True
        self._is_asked = True
        self._newest_before_question = self._newest
        self._is_answered = False
        self._first_answer_s = None

    def hear(self, answer: bytes, waited_s: float) -> None:
        """Note a message on the topic of the answers."""
        self._newest = answer
        is_new = answer != self._newest_before_question
        if is_new and not self._is_answered:
            self._is_answered = True
            self._slowest_s = max(self._slowest_s, waited_s)
            self._first_answer_s = waited_s
        elif self._first_answer_s is None:
            self._first_answer_s = waited_s

    def may_go_on(self, waited_s: float) -> bool:
        """Whether the next question may be asked."""
        if not self._is_asked or self._is_answered or waited_s >= self._within_s:
            return True
        return self._first_answer_s is not None and waited_s >= self._patience_s

    def is_over(self, waited_s: float) -> bool:
        """Whether every answer to the last question is there, or was waited for."""
        if not self._is_asked or waited_s >= self._within_s:
            return True
        if self._is_behind or self._first_answer_s is None:
            return False
        if self._is_answered:
            return waited_s >= self._first_answer_s + _COPY_S
        return waited_s >= self._patience_s

    @property
    def _patience_s(self) -> float:
        """How long the newest answer may be a copy of the one before."""
        return max(_COPY_S, _LONGER * self._slowest_s)
