"""Offers a service to clients of the student; and what both kinds of servers share."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor

from grader.assignment.stimuli.kinds.serve import ServeService
from grader.findings.fields import unlike
from grader.recording.interaction import Asked
from grader.recording.model import NS
from grader.run.cell.interfaces import import_interface
from grader.run.stimuli.context import Playing, StimulusContext, plays
from grader.run.stimuli.filling import filled, plain
from sim.node import make_node

# What a client does with the last answer, or asks too much, is still of interest.
_LINGER_NS = NS
# A float32 that went over the wire is not the number of the YAML any more.
_SAME = 1e-6
_MOST_AT_ONCE = 64
_FOREVER_S = 1e6
_LOOK_NS = NS // 2


class Serving(Playing):
    """A server with a node and threads of its own, so that its callbacks may wait."""

    asks = True
    takes = ""
    """What stands behind its name in the name of the service that takes requests."""

    def __init__(self, order: Any, context: StimulusContext) -> None:
        super().__init__(order, context)
        self.server = order.serve + self.takes
        self._interface: Any = import_interface(order.type)
        self._given: set[int] = set()
        self._open = 0
        self._leaves_waiting = False
        self._lock = threading.Lock()
        self._is_there = False
        if order.after == 0.0:
            self.play(0.0)

    def create(self, node: Any, group: ReentrantCallbackGroup) -> None:
        """Create the server in its node."""
        raise NotImplementedError

    def play(self, elapsed_s: float) -> None:
        """Offer it from now on."""
        if self._is_there:
            return
        self._is_there = True
        context = self._context.probe.node.context
        node = make_node(f"rosgrade{self._order.serve.replace('/', '_')}", context)
        self.create(node, ReentrantCallbackGroup())
        executor = MultiThreadedExecutor(_MOST_AT_ONCE, context=context)
        executor.add_node(node)
        # It answers until the process ends; what comes after the observation is not noted.
        threading.Thread(target=executor.spin, daemon=True).start()

    def tick(self, elapsed_s: float | None) -> None:
        """Appear when it is due, and see whether the executors of its clients spin."""
        super().tick(elapsed_s)
        probe, there = self._context.probe, self._context.graph.clients
        for node in {one.node for one in there if one.vanished_ns is None}:
            if time.time_ns() - probe.executor_calls.last_called_ns(node) > _LOOK_NS:
                self._context.call_executor(node)

    @property
    def due_s(self) -> float | None:
        """When it appears."""
        return None if self._is_there else float(self._order.after)

    @property
    def is_done(self) -> bool:
        """Whether every answer was given, the last one a moment ago."""
        waits = self._open or self._leaves_waiting
        through = len(self._given) == len(self._order.answers) and not waits
        return through and time.time_ns() - (self.last_ns or 0) > _LINGER_NS

    def noting_faults(self, callback: Callable[..., Any]) -> Callable[..., Any]:
        """The callback, whose exceptions make the run a fault: no client must lose by them."""

        def called(*arguments: Any) -> Any:
            try:
                return callback(*arguments)
            except Exception as error:
                if self._context.probe.recording:
                    self._context.faults.append(f"the server {self._order.serve} failed: {error!r}")
                raise

        return called

    def ask(self, message: Any) -> tuple[int, Any]:
        """Note a request or a goal; its number, and the answer to it after its delay.

        It is the next answer that fits, the last one again and again; None if none fits.
        """
        now_ns, fields, order = time.time_ns(), plain(message), self._order
        fitting = [
            number
            for number, answer in enumerate(order.answers)
            if not unlike(fields, answer.when, _SAME)
        ]
        asked = self._context.asked
        with self._lock:
            fresh = [number for number in fitting if number not in self._given] or fitting[-1:]
            self._given.update(fresh[:1])
            answer = order.answers[fresh[0]] if fresh else None
            delay_s = answer.delay_s if answer is not None else 0.0
            self._leaves_waiting = math.isinf(delay_s)
            self._open += not self._leaves_waiting
            status = "unanswered" if self._leaves_waiting else ""
            number = len(asked)
            if self._context.probe.recording and number < self._context.limits.messages:
                asked.append(Asked(order.serve, order.type, fields, now_ns, status))
        time.sleep(min(delay_s, _FOREVER_S))
        return number, answer

    def note(self, number: int, *, ends: bool = False, **changes: Any) -> None:
        """Note what became of a request or a goal."""
        asked, now_ns = self._context.asked, time.time_ns()
        if ends:
            changes["ended_ns"] = now_ns
        with self._lock:
            if self._context.probe.recording and number < len(asked):
                asked[number] = replace(asked[number], **changes)
            if ends:
                self._open -= 1
                self.last_ns = now_ns


@plays(ServeService)
class ServingService(Serving):
    """A service of the probe."""

    def create(self, node: Any, group: ReentrantCallbackGroup) -> None:
        """Create the service."""
        name = self._order.serve
        answer = self.noting_faults(self._answer)
        node.create_service(self._interface, name, answer, callback_group=group)

    def _answer(self, message: Any, response: Any) -> Any:
        number, answer = self.ask(message)
        filled(response, answer.response if answer is not None else {}, time.time_ns())
        self.note(number, ends=True, status="answered", answer=plain(response))
        return response
