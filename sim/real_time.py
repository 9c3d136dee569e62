"""A simulation in real time: which steps to do now, and a loop that does them."""

from __future__ import annotations

import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Protocol

from rclpy.node import Node

from sim.motion import NS
from sim.pacing import Lateness, Pacer


class LateSink(Protocol):
    """Who wants to know of steps that are late."""

    def on_late(self, lateness: Lateness) -> None:
        """Called when steps are late, which are done right after this call."""


class RealTime(ABC):
    """Base of what does the steps of a simulation in real time, in fixed steps.

    Its loop calls :meth:`start` once and then :meth:`catch_up` again and again, each time at or
    after the deadline that the last call returned; :meth:`run` does so until an event is set.
    """

    def __init__(
        self, node: Node, sink: LateSink | None, steady_ns: Callable[[], int], step_ns: int
    ) -> None:
        """Begin with a clock that stands; ``steady_ns`` reads a steady clock."""
        self._node: Any = node  # rclpy is typed in parts only
        self._late, self._steady_ns, self._step_ns = sink, steady_ns, step_ns
        self._pacer: Pacer | None = None
        self._stamp_ns = 0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self.run, args=(self._stop,), daemon=True)

    @abstractmethod
    def _take(self, now_ns: int) -> None:
        """Take what has arrived until a simulated time."""

    @abstractmethod
    def _advance(self) -> None:
        """Do one step, and publish what it brings."""

    def _next_visible_ns(self) -> int | None:
        """Simulated time of the next step that anybody can see; by default each can be seen."""
        return 0

    def start(self) -> int:
        """Let simulated time begin now; returns when to call :meth:`catch_up`."""
        self._pacer = Pacer(self._steady_ns(), self._step_ns)
        # Not a node's clock, for a student may set the parameter use_sim_time of one.
        self._stamp_ns = time.time_ns()
        return self._pacer.deadline_ns

    def catch_up(self) -> int:
        """Do every step that is over.

        Returns:
            Reading of the steady clock at which to call again; in the past if there was more
            to catch up than is done at once. Calling earlier does no harm.
        """
        if self._pacer is None:
            return self.start()
        pacer, now_ns = self._pacer, self._steady_ns()
        due = pacer.due(now_ns)
        if not due:
            return pacer.deadline_ns
        lateness = pacer.lateness(now_ns)
        if lateness is not None and self._late is not None:
            self._late.on_late(lateness)
        self._take(now_ns - pacer.begin_ns)
        for _ in range(due):
            self._advance()
            pacer.done += 1
        return pacer.plan(self._next_visible_ns())

    def run(self, stop: threading.Event) -> None:
        """Keep time until ``stop`` is set or the node's context is shut down."""
        deadline_ns = self.start()
        while not stop.is_set() and self._node.context.ok():
            wait_s = (deadline_ns - self._steady_ns()) / NS
            if wait_s > 0.0 and stop.wait(wait_s):
                return
            try:
                deadline_ns = self.catch_up()
            except RuntimeError:  # the base of rclpy's RCLError
                if self._node.context.ok():
                    raise
                return  # the context was shut down within the step

    def run_in_thread(self) -> None:
        """The same in a thread of its own, until :meth:`end`."""
        self._thread.start()

    def end(self) -> None:
        """End the thread, if it runs."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
