"""Calls services of the student's nodes that answer only while they spin."""

from __future__ import annotations

import time
from dataclasses import dataclass

from grader.recording.model import Owner
from grader.run.stimuli.context import Playing, StimulusContext, plays


@dataclass(frozen=True)
class ListParametersOrder:
    """Call the parameter services of all nodes of the student."""

    every_s: float


@plays(ListParametersOrder)
class ListingParameters(Playing):
    """Calls ``list_parameters`` of every node, or what stands in for it; it has no end."""

    def __init__(self, order: ListParametersOrder, context: StimulusContext) -> None:
        super().__init__(order, context)
        self._next = 0.0
        self._due_s: float | None = None

    @property
    def due_s(self) -> float | None:
        """When to call next: calls that wait for a message would keep the student's rhythm."""
        return self._due_s

    def tick(self, elapsed_s: float | None) -> None:
        """Call when it is due; also before the first match, since a node may be blocked."""
        now = time.monotonic()
        if now >= self._next and self._context.is_set_up:
            self._next = now + self._order.every_s
            there = (node for node in self._context.graph.nodes if node.vanished_ns is None)
            for name in dict.fromkeys(node.name for node in there if node.owner is Owner.STUDENT):
                self._context.call_executor(name)
        self._due_s = None
        if elapsed_s is not None and self._next > now:
            self._due_s = elapsed_s + self._next - now
