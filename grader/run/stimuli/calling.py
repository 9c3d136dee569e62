"""Calls a service of the student, once it is there."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, Protocol

from grader.recording.event import Wait
from grader.recording.model import NS
from grader.run.host.stopwatch import Stopwatch
from grader.run.stimuli.asking import NO_SERVER, Asked
from grader.run.stimuli.context import Playing, StimulusContext, plays

_POLL_S = 0.02
# The server may match the client, for its answers, a moment later than the client the server.
_GRACE_S = 0.1
_LOOK_NS = NS // 2
"""Time between two looks whether a node spins."""
_MISSING_S = 1.0
"""What has not come so long after the graph's last change will hardly come."""
_UNCALLABLE_S = 1.0
"""A node that could not be asked for so long has none of the services that would tell."""
MARGIN_S = 0.25
"""What is waited for is waited for a little longer, so that its time has passed in every clock."""


class RequestOrder(Protocol):
    """What the orders have in common that ask something of a node."""

    @property
    def after_s(self) -> float:
        """Not before so long after the first match."""

    @property
    def within_s(self) -> float:
        """How long to wait for an answer."""


@dataclass(frozen=True)
class CallOrder:
    """Call a service.

    Attributes:
        every_s: Time between two requests; None for the next after the answer.
    """

    service: str
    type: str
    requests: tuple[dict[str, Any], ...]
    at_once: int = 1
    after_s: float = 0.0
    every_s: float | None = None
    within_s: float = 2.0


class Readiness:
    """Waits until a server of the student's is there and its node spins, or in vain."""

    def __init__(self, what: str, service: str, context: StimulusContext) -> None:
        """Nothing is waited for yet."""
        self._what = what
        self._service = service
        self._context = context
        self._began_ns = 0
        self._there: Stopwatch | None = None
        self.there_ns = 0
        self.given_up = False

    @property
    def is_in_vain(self) -> bool:
        """Whether it is waited for, and is not there."""
        return self._began_ns > 0 and self._there is None

    @property
    def never_answered(self) -> bool:
        """Whether it is there, but its node never answered what it answers while it spins."""
        node = self._context.server(self._service) if self._there is not None else None
        return node is not None and self._context.probe.answers(node) is False

    @property
    def is_missing(self) -> bool:
        """Whether it is not there, and probably will not come."""
        return self._there is None and self._context.calm_s > _MISSING_S

    def met(self, is_there: bool) -> bool:
        """Whether it can be asked.

        What is asked while a constructor waits for something would be late through no fault of
        the server's: its node has to answer another call first, unless it does not in the time
        that it has to start.
        """
        self._began_ns = self._began_ns or time.time_ns()
        if not is_there:
            self._there = None
            settle_s = self._context.limits.settle_s
            if not self.given_up and self._context.calm_s > settle_s:
                self.given_up = True
                self._context.waits.append(Wait(self._what, settle_s, self._began_ns))
            return False
        self.given_up = False
        if self._there is None:
            self._there, self.there_ns = Stopwatch(self._context.meter), time.time_ns()
        if self._there.elapsed_s < _GRACE_S:
            return False
        spins = self.look()
        limit_s = _UNCALLABLE_S if spins is None else self._context.limits.discovery_s
        return bool(spins) or self._there.elapsed_s > limit_s

    def look(self) -> bool | None:
        """Ask the server's node for something that it answers only while it spins.

        Returns:
            Whether it has ever answered that; None if it cannot be asked.
        """
        node = self._context.server(self._service)
        if node is None:
            return None
        if time.time_ns() - self._context.probe.last_called_ns(node) > _LOOK_NS:
            self._context.call_executor(node)
        return self._context.probe.answers(node)


class Asking(Playing):
    """A stimulus that asks something of a server, when what is asked before it was answered."""

    def __init__(
        self, order: RequestOrder, what: str, service: str, context: StimulusContext
    ) -> None:
        """Take a place in the order of what is asked."""
        self.after_s = order.after_s
        self._within_s = order.within_s
        self._context = context
        self._ready = Readiness(what, service, context)
        self._since_asked: Stopwatch | None = None
        self._now_s = 0.0
        self._place = len(context.asking)
        context.asking.append(self)

    @property
    def asks(self) -> bool:
        """It does."""
        return True

    @property
    def is_through(self) -> bool:
        """Whether what comes after it need not wait for it any more."""
        return self.is_done

    @property
    def due_s(self) -> float | None:
        """When to look next."""
        return None if self.is_done else max(self.after_s, self._now_s + _POLL_S)

    def holds_up(self, other: Asking) -> bool:
        """Whether another one has to wait for it: it is due before, or stands before it.

        Of those that are due at once, one that is not there holds up none.
        """
        if self.is_through or self._place == other._place:
            return False
        if self.after_s == other.after_s:
            return self._place < other._place and not self._ready.is_missing
        # On a busy machine a service may be found later than another one that is due later.
        return self.after_s < other.after_s

    @property
    def _is_turn(self) -> bool:
        return not any(item.holds_up(self) for item in self._context.asking)

    def _wait_for_answer(self) -> None:
        """Begin to wait; what the machine takes meanwhile does not count."""
        self._since_asked = Stopwatch(self._context.meter)

    @property
    def _waits(self) -> bool:
        """Whether the answer may still come."""
        since = self._since_asked
        return since is not None and since.elapsed_s < self._within_s + MARGIN_S

    def _go_on(self, elapsed_s: float) -> None:
        """Note the time; where an answer is waited for, see whether the node spins meanwhile."""
        self._now_s = elapsed_s
        since = self._since_asked
        if since is not None and since.elapsed_s > _GRACE_S and not self.is_done:
            self._ready.look()


@plays(CallOrder)
class Calling(Asking):
    """Requests to one service, one after another or several at once."""

    def __init__(self, order: CallOrder, context: StimulusContext) -> None:
        """Nothing is called yet."""
        super().__init__(order, f"a service {order.service}", order.service, context)
        self._order = order
        self._started = False
        self._sent = 0
        self._sent_s = 0.0
        self._round: list[Asked] = []
        self._failed: str | None = None

    @property
    def is_through(self) -> bool:
        """A sequence with a pace of its own holds nobody up."""
        return self.is_done or (self._order.every_s is not None and self._sent > 0)

    @property
    def is_done(self) -> bool:
        """Whether everything was asked, and answered or waited for; or nobody was there."""
        if self._failed is not None or self._ready.given_up:
            return True
        return self._sent >= len(self._order.requests) and self._is_over()

    @property
    def due_s(self) -> float | None:
        """When to look next."""
        every_s = self._order.every_s
        if every_s is not None and 0 < self._sent < len(self._order.requests):
            return self._sent_s + every_s
        return super().due_s

    def tick(self, elapsed_s: float | None) -> None:
        """Call when it is due."""
        order = self._order
        if elapsed_s is None or elapsed_s < order.after_s or self._failed is not None:
            return
        self._go_on(elapsed_s)
        if not self._started:
            try:
                there = self._context.asker.is_ready(order.service, order.type)
            except ImportError as error:
                self._failed = f"the interface {order.type} is not installed ({error})"
                return
            self._started = self._ready.met(there) and self._is_turn
        if not self._started or self._sent >= len(order.requests):
            return
        if self._sent and not self._is_next_due():
            return
        request = order.requests[self._sent]
        self._round = [
            self._context.asker.ask(order.service, order.type, request)
            for _ in range(order.at_once)
        ]
        self._sent += 1
        self._sent_s = elapsed_s
        self._wait_for_answer()

    def finish(self) -> None:
        """Note what could not be sent, unless it was not due yet."""
        order = self._order
        if self._failed is not None or self._ready.is_in_vain:
            error = self._failed or NO_SERVER
            self._context.asker.fail(order.service, order.type, order.requests[self._sent], error)
        elif self._ready.never_answered and not self._started:
            request = order.requests[0]
            self._context.asker.wait(order.service, order.type, request, self._ready.there_ns)

    def _is_next_due(self) -> bool:
        if self._order.every_s is not None:
            return self._now_s - self._sent_s >= self._order.every_s
        return self._is_over()

    def _is_over(self) -> bool:
        """Whether the newest calls were answered, or have had their time for it."""
        return all(item.is_over for item in self._round) or not self._waits
