"""Calls a service of the student, once it is there."""

from __future__ import annotations

import time

from grader.recording.model import Wait
from grader.run.stimuli.asking import NO_SERVER, Asked
from grader.run.stimuli.orders import CallOrder
from grader.run.stimuli.stage import Playing, Stage

_POLL_S = 0.02
# The server may match the client, for its answers, a moment later than the client the server.
_GRACE_S = 0.1
MARGIN_S = 0.25
"""What is waited for is waited for a little longer, so that its time has passed in every clock."""


class Readiness:
    """Waits until something of the student's is there, or nothing more is to be expected."""

    def __init__(self, what: str, stage: Stage) -> None:
        """Nothing is waited for yet.

        Args:
            what: Such as ``a service /add``, for the recording.
            stage: Knows how calm the graph is.
        """
        self._what = what
        self._stage = stage
        self._began_ns = 0
        self._ready_s: float | None = None
        self.given_up = False

    @property
    def is_in_vain(self) -> bool:
        """Whether it is waited for, and is not there."""
        return self._began_ns > 0 and self._ready_s is None

    def met(self, is_there: bool, elapsed_s: float) -> bool:
        """Whether it has been there for long enough to be used.

        Args:
            is_there: Whether it is there now.
            elapsed_s: On the player's clock.
        """
        self._began_ns = self._began_ns or time.time_ns()
        if is_there:
            self.given_up = False
            if self._ready_s is None:
                self._ready_s = elapsed_s
            return elapsed_s - self._ready_s >= _GRACE_S
        self._ready_s = None
        settle_s = self._stage.limits.settle_s
        if not self.given_up and self._stage.calm_s > settle_s:
            self.given_up = True
            self._stage.waits.append(Wait(self._what, settle_s, self._began_ns))
        return False


class Asking(Playing):
    """A stimulus that asks something of a service; one waits for those that come before it."""

    def __init__(self, after_s: float, stage: Stage) -> None:
        """Take a place in the order of what is asked.

        Args:
            after_s: When it is due, on the player's clock.
            stage: Knows the others.
        """
        self.after_s = after_s
        self._stage = stage
        stage.asking.append(self)

    @property
    def asks(self) -> bool:
        """It does."""
        return True

    @property
    def is_through(self) -> bool:
        """Whether what is due later need not wait for it any more."""
        return self.is_done

    @property
    def _is_turn(self) -> bool:
        # On a busy machine a service may be found later than another one that is due later.
        return all(item.is_through for item in self._stage.asking if item.after_s < self.after_s)


class Calling(Asking):
    """Requests to one service, one after another or several at once."""

    def __init__(self, order: CallOrder, stage: Stage) -> None:
        """Nothing is called yet."""
        super().__init__(order.after_s, stage)
        self._order = order
        self._ready = Readiness(f"a service {order.service}", stage)
        self._started = False
        self._sent = 0
        self._sent_s = 0.0
        self._now_s = 0.0
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
        if self.is_done:
            return None
        if (
            self._started
            and self._order.every_s is not None
            and self._sent < len(self._order.requests)
        ):
            return self._sent_s + self._order.every_s
        return max(self._order.after_s, self._now_s + _POLL_S)

    def tick(self, elapsed_s: float | None) -> None:
        """Call when it is due."""
        order = self._order
        if elapsed_s is None or elapsed_s < order.after_s or self._failed is not None:
            return
        self._now_s = elapsed_s
        if not self._started:
            try:
                there = self._stage.asker.is_ready(order.service, order.type)
            except ImportError as error:
                self._failed = f"the interface {order.type} is not installed ({error})"
                return
            self._started = self._ready.met(there, elapsed_s)
        if not self._started or self._sent >= len(order.requests) or not self._is_turn:
            return
        if self._sent and not self._is_next_due():
            return
        request = order.requests[self._sent]
        self._round = [
            self._stage.asker.ask(order.service, order.type, request) for _ in range(order.at_once)
        ]
        self._sent += 1
        self._sent_s = elapsed_s

    def finish(self) -> None:
        """Note what could not be sent, unless it was not due yet."""
        if self._failed is not None or self._ready.is_in_vain:
            order = self._order
            error = self._failed or NO_SERVER
            self._stage.asker.fail(order.service, order.type, order.requests[self._sent], error)

    def _is_next_due(self) -> bool:
        if self._order.every_s is not None:
            return self._now_s - self._sent_s >= self._order.every_s
        return self._is_over()

    def _is_over(self) -> bool:
        """Whether the newest calls were answered, or have had their time for it."""
        answered = all(item.is_over for item in self._round)
        return answered or self._now_s - self._sent_s >= self._order.within_s + MARGIN_S
