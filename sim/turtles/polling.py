"""Subscriptions and services that no executor serves: their owner takes what has arrived.

So what arrives acts in a simulated moment that depends on its arrival alone, and not on when a
thread happened to run.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

from rclpy.node import Node

from sim.polled import PolledGroup, never

Act = Callable[[], None]

_MOST_TAKEN = 100
"""Of one subscription or service at a look, for a student may send faster than it is taken."""
_MOST_PENDING = 5_000


@dataclass(frozen=True)
class Request:
    """A request to a service, which can be answered later.

    Attributes:
        arrived_ns: When the middleware had received it.
        on_answer: Called with it and with its answer.
    """

    service: Any
    header: Any
    message: Any
    arrived_ns: int
    on_answer: Callable[[Request, Any], None]

    def answer(self, response: Any = None) -> None:
        """Answer it, by default with an empty response."""
        if response is None:
            response = self.service.srv_type.Response()
        self.on_answer(self, response)
        self.service.send_response(response, self.header)


class Inbox:
    """What has arrived, in the order of its arrival, and not yet acted."""

    def __init__(self, node: Node, on_answer: Callable[[Request, Any], None]) -> None:
        """Begin with nothing to take from; ``on_answer`` gets each request and its answer."""
        self._node: Any = node
        self._on_answer = on_answer
        self._group = PolledGroup()
        self._subscriptions: dict[Any, Callable[[Any], None]] = {}
        self._services: dict[Any, Callable[[Request], None]] = {}
        self._pending: list[tuple[int, int, Act]] = []
        self._numbers = itertools.count()

    def subscribe(self, kind: Any, topic: str, qos: Any, act: Callable[[Any], None]) -> Any:
        """Take messages on a topic."""
        subscription = self._node.create_subscription(
            kind, topic, never, qos, callback_group=self._group
        )
        self._subscriptions[subscription] = act
        return subscription

    def serve(self, kind: Any, name: str, act: Callable[[Request], None]) -> Any:
        """Take requests to a service."""
        service = self._node.create_service(kind, name, never, callback_group=self._group)
        self._services[service] = act
        return service

    def serve_own(self) -> None:
        """Take requests to the services that the node has by itself, such as its parameters'."""
        for service in self._node.services:
            self._services.setdefault(service, _answer_as_rclpy)

    @property
    def services(self) -> frozenset[str]:
        """Names of the services that it takes requests to."""
        # rclpy names those of parameters without the slash in front.
        return frozenset(f"/{service.srv_name.lstrip('/')}" for service in [*self._services])

    def forget(self, entity: Any) -> None:
        """Take nothing from a subscription or a service any more, and destroy it."""
        if self._subscriptions.pop(entity, None) is not None:
            self._node.destroy_subscription(entity)
        elif self._services.pop(entity, None) is not None:
            self._node.destroy_service(entity)

    def take(self, begin_ns: int, now_ns: int) -> None:
        """Take what has arrived by now; times count from ``begin_ns`` on the system's clock."""
        for subscription, act in self._subscriptions.items():
            for message, info in self._taken(_take_message, subscription):
                # Arrived by now, even if the system's clock has jumped meanwhile.
                arrived_ns = min(info["received_timestamp"] - begin_ns, now_ns)
                self._keep(arrived_ns, partial(act, message))
        for service, answer in self._services.items():
            for message, info in self._taken(_take_request, service):
                header, received_ns = info.request_id, info.received_timestamp
                request = Request(service, header, message, received_ns, self._on_answer)
                arrived_ns = min(received_ns - begin_ns, now_ns)
                self._keep(arrived_ns, partial(answer, request))

    def act(self, time_ns: int) -> None:
        """Let everything act that had arrived by a time."""
        while self._pending and self._pending[0][0] <= time_ns:
            _, _, act = heapq.heappop(self._pending)
            act()

    def _keep(self, arrived_ns: int, act: Act) -> None:
        if len(self._pending) < _MOST_PENDING:
            heapq.heappush(self._pending, (arrived_ns, next(self._numbers), act))

    def _taken(self, take: Callable[[Any], Any], entity: Any) -> Iterator[Any]:
        """What a subscription or a service holds, each with what the middleware says of it."""
        for _ in range(_MOST_TAKEN):
            try:
                with entity.handle:
                    taken = take(entity)
            except RuntimeError:  # a payload that is no such message
                if not self._node.context.ok():
                    raise
                continue
            if taken is None or taken[0] is None:
                return
            yield taken


def _take_message(subscription: Any) -> Any:
    return subscription.handle.take_message(subscription.msg_type, False)


def _take_request(service: Any) -> Any:
    return service.handle.service_take_request(service.srv_type.Request)


def _answer_as_rclpy(request: Request) -> None:
    """Answer as rclpy's own executors do, or not at all where rclpy fails by the request."""
    service = request.service
    with suppress(Exception):
        request.answer(service.callback(request.message, service.srv_type.Response()))
