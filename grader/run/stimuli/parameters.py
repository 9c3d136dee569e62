"""Calls the parameter services of the student's nodes, which answer only while they spin."""

from __future__ import annotations

import time

from grader.recording.model import Owner
from grader.run.stimuli.orders import ListParametersOrder
from grader.run.stimuli.stage import Playing, Stage


class ListingParameters(Playing):
    """Calls ``list_parameters`` of every node; it has no end."""

    def __init__(self, order: ListParametersOrder, stage: Stage) -> None:
        """Nothing is called yet."""
        self._every_s = order.every_s
        self._stage = stage
        self._next = 0.0

    def tick(self, elapsed_s: float | None) -> None:
        """Call when it is due; also before the first match, since a node may be blocked."""
        now = time.monotonic()
        if now < self._next or not self._stage.is_set_up:
            return
        self._next = now + self._every_s
        for node in self._stage.graph.nodes:
            if node.owner is Owner.STUDENT and node.vanished_ns is None:
                self._stage.probe.call_list_parameters(node.name)
