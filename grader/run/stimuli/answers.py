"""Answers to questions, matched one by one: a node may answer twice, late or not at all."""

from __future__ import annotations

# Copies of an answer come together.
_COPY_S = 0.05
# An answer that is the same as the one before may be a copy of it: the true one may take longer
# than any before it did.
_LONGER = 2.0


class Answers:
    """Counts the answers on a topic, while one question after another is published.

    A second answer to one question must not pass for the answer to the next: the questions would
    run ahead of the node, which would then lose some of them, or be ended before its last answer.
    """

    def __init__(self, within_s: float) -> None:
        self._within_s = within_s
        self._newest: bytes | None = None
        self._before: bytes | None = None
        self._is_new = False
        self._first_s: float | None = None
        self._is_asked = False
        self._is_behind = False
        self._longest_s = 0.0

    def ask(self) -> None:
        """Note that a question is published."""
        # Its answer may still come, when that to this question is expected.
        self._is_behind |= self._is_asked and self._first_s is None
        self._is_asked = True
        self._before = self._newest
        self._is_new = False
        self._first_s = None

    def hear(self, answer: bytes, waited_s: float) -> None:
        """Note a message on the topic of the answers."""
        self._newest = answer
        is_new = answer != self._before
        if is_new and not self._is_new:
            self._longest_s = max(self._longest_s, waited_s)
            self._first_s = waited_s
        elif self._first_s is None:
            self._first_s = waited_s
        self._is_new |= is_new

    def may_go_on(self, waited_s: float) -> bool:
        """Whether the next question may be asked."""
        if not self._is_asked or waited_s >= self._within_s:
            return True
        return self._is_new or (self._first_s is not None and waited_s >= self._patience_s)

    def is_over(self, waited_s: float) -> bool:
        """Whether every answer to the last question is there, or was waited for."""
        if not self._is_asked or waited_s >= self._within_s:
            return True
        if self._is_behind or self._first_s is None:
            return False
        return waited_s >= (self._first_s + _COPY_S if self._is_new else self._patience_s)

    @property
    def _patience_s(self) -> float:
        """How long the newest answer may be a copy of the one before."""
        return max(_COPY_S, _LONGER * self._longest_s)
