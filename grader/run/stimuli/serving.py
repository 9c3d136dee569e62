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

_LINGER_NS = NS
"""What a client does with the last answer, or asks too much, is still of interest."""
_SAME = 1e-6
"""A float32 that went over the wire is not the number of the YAML any more."""
_MOST_AT_ONCE = 64
_FOREVER_S = 1e6
"""Longer than any run; time.sleep refuses infinity."""
_LOOK_NS = NS // 2


class Serving(Playing):
    """A server with a node and threads of its own, so that its callbacks may wait."""

    asks = True
    request_suffix = ""
    """What stands behind its name in the name of the service that takes requests."""

    def __init__(self, order: Any, context: StimulusContext) -> None:
        super().__init__(order, context)
        self.server = order.serve + self.request_suffix
        self._interface: Any = import_interface(order.type)
        self._used_answers: set[int] = set()
        self._open_requests = 0
        self._leaves_waiting = False
        """Whether the newest request is never answered."""
        self._lock = threading.Lock()
        self._is_offered = False
        if order.after == 0.0:
            self.play(0.0)

    def create(self, node: Any, group: ReentrantCallbackGroup) -> None:
        """Create the server in its node."""
        raise NotImplementedError

    def play(self, elapsed_s: float) -> None:
        """Offer it from now on."""
        if self._is_offered:
            return
        self._is_offered = True
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
        calls, clients = self._context.probe.executor_calls, self._context.graph.clients
        for node in {client.node for client in clients if client.vanished_ns is None}:
            if time.time_ns() - calls.last_called_ns(node) > _LOOK_NS:
                self._context.call_executor(node)

    @property
    def due_s(self) -> float | None:
        """When it appears."""
        return None if self._is_offered else float(self._order.after)

    @property
    def is_done(self) -> bool:
        """Whether every answer was given, the last one a moment ago."""
        if self._open_requests or self._leaves_waiting:
            return False
        if len(self._used_answers) < len(self._order.answers):
            return False
        return time.time_ns() - (self.last_ns or 0) > _LINGER_NS

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

    def receive(self, message: Any) -> tuple[int, Any]:
        """Note a request or a goal; its number and, after its delay, the answer to it."""
        now_ns, fields, order = time.time_ns(), plain(message), self._order
        asked = self._context.asked
        with self._lock:
            answer = self._choose_answer(fields)
            delay_s = answer.delay_s if answer is not None else 0.0
            self._leaves_waiting = math.isinf(delay_s)
            if not self._leaves_waiting:
                self._open_requests += 1
            status = "unanswered" if self._leaves_waiting else ""
            number = len(asked)
            if self._context.probe.recording and number < self._context.limits.messages:
                asked.append(Asked(order.serve, order.type, fields, now_ns, status))
        time.sleep(min(delay_s, _FOREVER_S))
        return number, answer

    def _choose_answer(self, fields: Any) -> Any:
        """The next answer that fits a request, the last one again and again; None if none fits."""
        answers = self._order.answers
        fitting = [n for n, answer in enumerate(answers) if not unlike(fields, answer.when, _SAME)]
        if not fitting:
            return None
        unused = [number for number in fitting if number not in self._used_answers]
        chosen = unused[0] if unused else fitting[-1]
        self._used_answers.add(chosen)
        return answers[chosen]

    def note(self, number: int, *, ends: bool = False, **changes: Any) -> None:
        """Note what became of a request or a goal."""
        asked, now_ns = self._context.asked, time.time_ns()
        if ends:
            changes["ended_ns"] = now_ns
        with self._lock:
            if self._context.probe.recording and number < len(asked):
                asked[number] = replace(asked[number], **changes)
            if ends:
                self._open_requests -= 1
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
        number, answer = self.receive(message)
        filled(response, answer.response if answer is not None else {}, time.time_ns())
        self.note(number, ends=True, status="answered", answer=plain(response))
        return response
