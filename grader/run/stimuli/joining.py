"""Joins a topic in the middle of a run."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

from grader.assignment.stimuli.kinds.join import Join as JoinLate
from grader.recording.model import Join, Qos
from grader.run.cell.interfaces import qos_profile
from grader.run.stimuli.context import Playing, StimulusContext, plays

# What a publisher keeps for late joiners arrives within this of the match.
_HISTORY_S = 0.5
_POLL_S = 0.02


@plays(JoinLate)
class Joining(Playing):
    """A late joiner."""

    def __init__(self, order: JoinLate, context: StimulusContext) -> None:
        super().__init__(order, context)
        self._subscription: Any = None
        self._joined_s = 0.0
        self._matched_s: float | None = None
        self._now_s = 0.0

    @property
    def due_s(self) -> float | None:
        """Its time to join; then until it is matched, in short steps."""
        if self._subscription is None:
            return float(self._order.after)
        return None if self.is_done else self._now_s + _POLL_S

    @property
    def is_done(self) -> bool:
        """Whether it has been matched long enough, or was not in all that time."""
        if self._subscription is None:
            return False
        if self._matched_s is not None:
            return self._now_s - self._matched_s > _HISTORY_S
        return self._now_s - self._joined_s > self._context.limits.settle_s

    def play(self, elapsed_s: float) -> None:
        """Join; then note the match."""
        order, joins = self._order, self._context.joins
        self._now_s = elapsed_s
        if self._subscription is None:
            self._joined_s = elapsed_s
            qos = Qos(order.reliability, order.durability, "keep_last", order.depth)
            joins[order.name] = Join(order.name, order.join, order.type, qos, time.time_ns())
            profile = qos_profile(order.reliability, order.durability, order.depth)
            join = self._context.probe.join
            self._subscription = join(order.name, order.join, order.type, profile)
        elif self._matched_s is None and self._subscription.get_publisher_count():
            self._matched_s = elapsed_s
            joins[order.name] = replace(joins[order.name], matched_ns=time.time_ns())
