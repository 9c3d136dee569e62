"""The stimulus that calls a service of the student, and the base of all that send requests."""

from __future__ import annotations

import time
from typing import Any

from grader.assignment.stimuli.kinds.request import CallService, Lifecycle
from grader.recording.interaction import NO_SERVER
from grader.recording.model import NS
from grader.run.host.stopwatch import Stopwatch
from grader.run.stimuli.context import Patience, Playing, StimulusContext, plays

_POLL_S = 0.02
_GRACE_S = 0.1
"""The server may match the client, for its answers, a moment later than the client the server."""
_LOOK_NS = NS // 2
"""Time between two looks whether a node spins."""
_MISSING_S = 1.0
"""A server that is missing so long after the graph's last change will hardly come."""
_UNCALLABLE_S = 1.0
"""A node that could not be called for so long has no service that shows whether it spins."""
MARGIN_S = 0.25
"""Every wait lasts a little longer, so that its time has passed on every clock."""


class Readiness:
    """Waits until a server of the student's is there and its node spins."""

    def __init__(self, what: str, service: str, context: StimulusContext) -> None:
        self._service = service
        self._context = context
        self._patience = Patience(what, context)
        self._since_appeared: Stopwatch | None = None
        self.appeared_ns = 0

    @property
    def given_up(self) -> bool:
        """Whether the server is not expected any more."""
        return self._patience.given_up

    @property
    def is_in_vain(self) -> bool:
        """Whether the wait for the server began, and it is not there."""
        return self._patience.began_ns > 0 and self._since_appeared is None

    @property
    def never_answered(self) -> bool:
        """Whether it is there, but its node never answered what it answers while it spins."""
        if self._since_appeared is None:
            return False
        node = self._context.server(self._service)
        return node is not None and self._has_answered(node) is False

    @property
    def is_missing(self) -> bool:
        """Whether it is not there, and probably will not come."""
        return self._since_appeared is None and self._context.calm_s > _MISSING_S

    def may_send(self, is_there: bool) -> bool:
        """Whether a request can be sent, to a server that is there or not; called again and again.

        A request during a constructor would be late through no fault of the server's: its node
        has to answer another call first, unless it does not in the time that it has to start.
        """
        if not self._patience.look(is_there):
            self._since_appeared = None
            return False
        if self._since_appeared is None:
            self._since_appeared, self.appeared_ns = Stopwatch(self._context.meter), time.time_ns()
        if self._since_appeared.elapsed_s < _GRACE_S:
            return False
        has_answered = self.call_node()
        if has_answered:
            return True
        is_uncallable = has_answered is None
        limit_s = _UNCALLABLE_S if is_uncallable else self._context.limits.discovery_s
        return self._since_appeared.elapsed_s > limit_s

    def call_node(self) -> bool | None:
        """Call the server's node for what it answers only while it spins, from time to time.

        Returns:
            Whether it ever answered; None if there is nothing to call.
        """
        node = self._context.server(self._service)
        if node is None:
            return None
        if time.time_ns() - self._context.probe.executor_calls.last_called_ns(node) > _LOOK_NS:
            self._context.call_executor(node)
        return self._has_answered(node)

    def _has_answered(self, node: str) -> bool | None:
        return self._context.probe.executor_calls.has_answered(node)


class Requesting(Playing):
    """A stimulus that sends requests to a server, after those before it were answered."""

    asks = True

    def __init__(self, order: Any, what: str, service: str, context: StimulusContext) -> None:
        super().__init__(order, context)
        self._ready = Readiness(what, service, context)
        self._since_sent: Stopwatch | None = None
        self._now_s = 0.0
        self._position = len(context.requests)
        context.requests.append(self)

    @property
    def is_through(self) -> bool:
        """Whether later requests need not wait for it any more."""
        return self.is_done

    @property
    def due_s(self) -> float | None:
        """When to look next."""
        return None if self.is_done else max(self._order.after, self._now_s + _POLL_S)

    def holds_up(self, other: Requesting) -> bool:
        """Whether another stimulus has to wait for this one, which is due or written earlier."""
        if self.is_through or self is other:
            return False
        if self._order.after == other._order.after:
            return self._position < other._position and not self._ready.is_missing
        # On a busy machine a service may be found later than another one that is due later.
        return bool(self._order.after < other._order.after)

    @property
    def _is_turn(self) -> bool:
        return not any(item.holds_up(self) for item in self._context.requests)

    def _wait_for_answer(self) -> None:
        self._since_sent = Stopwatch(self._context.meter)

    @property
    def _waits(self) -> bool:
        since = self._since_sent
        return since is not None and since.elapsed_s < self._order.within + MARGIN_S

    def play(self, elapsed_s: float) -> None:
        """Note the time; where an answer is waited for, see whether the node spins meanwhile."""
        self._now_s = elapsed_s
        since = self._since_sent
        if since is not None and since.elapsed_s > _GRACE_S and not self.is_done:
            self._ready.call_node()


@plays(CallService, Lifecycle)
class Calling(Requesting):
    """Requests to services of one node, one after another or several at once."""

    def __init__(self, order: CallService | Lifecycle, context: StimulusContext) -> None:
        self._requests = order.asked
        self._types = {request.service: request.type for request in self._requests}
        service = self._requests[0].service
        super().__init__(order, f"a service {service}", service, context)
        self._may_begin = False
        self._sent = 0
        self._last_sent_s = 0.0
        self._newest_calls: list[int] = []
        self._fault: str | None = None

    @property
    def is_through(self) -> bool:
        """Whether later requests need not wait."""
        return self.is_done or (self._sent > 0 and not self._order.in_turn)

    @property
    def is_done(self) -> bool:
        """Whether everything was sent, and answered or waited for; or there is no server."""
        if self._fault is not None or self._ready.given_up:
            return True
        return self._sent >= len(self._requests) and self._is_over

    @property
    def due_s(self) -> float | None:
        """When to look next."""
        if 0 < self._sent < len(self._requests):
            pause_s = self._requests[self._sent].pause_s
            if pause_s is not None:
                return self._last_sent_s + pause_s
        return super().due_s

    def play(self, elapsed_s: float) -> None:
        """Call when it is due."""
        calls = self._context.calls
        if self._fault is not None:
            return
        super().play(elapsed_s)
        if not self._may_begin:
            try:
                is_there = all(calls.is_ready(*service) for service in self._types.items())
            except ImportError as error:
                types = " and ".join(self._types.values())
                self._fault = f"the interface {types} is not installed ({error})"
                return
            self._may_begin = self._ready.may_send(is_there) and self._is_turn
        if not self._may_begin or self._sent >= len(self._requests):
            return
        if self._sent and not self._is_next_due:
            return
        request = self._requests[self._sent]
        self._newest_calls = [
            calls.send(request.service, request.type, request.fields)
            for _ in range(self._order.at_once)
        ]
        self._sent += 1
        self._last_sent_s = elapsed_s
        self._wait_for_answer()

    def finish(self) -> None:
        """Note what could not be sent, unless it was not due yet."""
        if self._fault is not None or self._ready.is_in_vain:
            self._note_unsent(self._fault or NO_SERVER)
        elif self._ready.never_answered and not self._may_begin:
            self._note_unsent("", self._ready.appeared_ns)

    def _note_unsent(self, error: str, since_ns: int = 0) -> None:
        request = self._requests[self._sent]
        self._context.calls.note_unsent(
            request.service, request.type, request.fields, error, since_ns
        )

    @property
    def _is_next_due(self) -> bool:
        pause_s = self._requests[self._sent].pause_s
        return self._is_over if pause_s is None else self._now_s - self._last_sent_s >= pause_s

    @property
    def _is_over(self) -> bool:
        return all(map(self._context.calls.is_over, self._newest_calls)) or not self._waits
