"""The base of all stimuli, and the context of the run that they act on."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from grader.recording.event import Intervention, Wait
from grader.recording.interaction import EXECUTOR_SERVICES, Asked, Goal
from grader.recording.model import NS, Endpoint, Join, Kind, Owner
from grader.run.cell.graph import GraphObserver
from grader.run.cell.probe import Probe
from grader.run.host.disturbance import DisturbanceMeter
from grader.run.host.stopwatch import Stopwatch
from grader.run.order import RunLimits
from grader.run.process.student import StudentProcesses
from grader.run.stimuli.service_calls import ServiceCalls

if TYPE_CHECKING:
    from grader.assignment.stimuli.stimulus_model import StimulusModel
    from grader.run.cell.simulator import SimulatedRobot

_SET_UP_S = 0.5
"""Who has added nothing to the graph for so long has left its constructors, or hangs in one."""
_SETTLED_NS = NS // 2
"""A node whose other services were seen so long ago has no parameter services."""

P = TypeVar("P", bound="Playing")


class Request(Protocol):
    """A stimulus that sends requests to a server, in the order of the YAML."""

    def holds_up(self, other: Any) -> bool:
        """Whether the other one has to wait for this one."""


@dataclass
class StimulusContext:
    """What a stimulus acts on; ``requests`` are those that send some, in the order of the YAML."""

    probe: Probe
    graph: GraphObserver
    students: StudentProcesses
    meter: DisturbanceMeter
    limits: RunLimits
    start: Callable[[str], None]
    waits: list[Wait]
    faults: list[str]
    robots: Mapping[str, SimulatedRobot] = field(default_factory=dict)
    asked: list[Asked] = field(default_factory=list)
    joins: dict[str, Join] = field(default_factory=dict)
    interventions: list[Intervention] = field(default_factory=list)
    goals: list[Goal] = field(default_factory=list)
    requests: list[Request] = field(default_factory=list)
    _calm: tuple[int, Stopwatch] | None = None

    @cached_property
    def calls(self) -> ServiceCalls:
        """Calls of services, apart from those that only show whether a node spins."""
        return ServiceCalls(self.probe, self.limits.message_bytes)

    def endpoints(self, kind: Kind, topic: str) -> list[Endpoint]:
        """The student's endpoints on a topic that are there at the moment."""
        return [
            item
            for item in self.graph.endpoints
            if item.owner is Owner.STUDENT
            and item.kind is kind
            and item.topic == topic
            and item.vanished_ns is None
        ]

    def server(self, service: str) -> str | None:
        """The student's node that offers a service at the moment, or None."""
        for offered in self.graph.services:
            if offered.name == service and offered.vanished_ns is None:
                return offered.node
        return None

    def call_executor(self, node: str) -> None:
        """Call a service of a node that it answers only while it spins."""
        first, second = EXECUTOR_SERVICES
        appeared_ns = {s.name: s.appeared_ns for s in self.graph.services if s.node == node}
        second_ns = appeared_ns.get(f"{node}/{second}")
        is_settled = second_ns is not None and time.time_ns() - second_ns > _SETTLED_NS
        lacks_first = is_settled and f"{node}/{first}" not in appeared_ns
        self.probe.executor_calls.call(node, second if lacks_first else first)

    @property
    def student_nodes(self) -> list[str]:
        """Names of the student's nodes that are there now."""
        present = (node for node in self.graph.nodes if node.vanished_ns is None)
        return list(dict.fromkeys(node.name for node in present if node.owner is Owner.STUDENT))

    @property
    def calm_s(self) -> float:
        """How long the graph has not changed, less what the host took meanwhile."""
        if self._calm is None or self._calm[0] != self.graph.changed_ns:
            self._calm = (self.graph.changed_ns, Stopwatch(self.meter))
        return self._calm[1].elapsed_s

    @property
    def is_set_up(self) -> bool:
        """Whether the student's nodes are past their constructors, as far as it shows."""
        if self.probe.last_message_ns is not None:
            return True
        return (time.time_ns() - self.graph.changed_ns) / NS > _SET_UP_S

    @property
    def is_heard(self) -> bool:
        """Whether the probe hears the student: on every topic, or on all that will be there."""
        topics = self.probe.student_topics
        if topics and all(self.endpoints(Kind.PUBLISHER, topic) for topic in topics):
            return True
        return self.is_set_up


class Patience:
    """Waits for something of the student's, until nothing in the graph has changed for long."""

    def __init__(self, what: str, context: StimulusContext) -> None:
        self._what = what
        self._context = context
        self.began_ns = 0
        self.given_up = False

    def look(self, is_there: bool) -> bool:
        """Note whether it is there; when it is given up, the wait is recorded."""
        self.began_ns = self.began_ns or time.time_ns()
        settle_s = self._context.limits.settle_s
        if is_there:
            self.given_up = False
        elif not self.given_up and self._context.calm_s > settle_s:
            self.given_up = True
            self._context.waits.append(Wait(self._what, settle_s, self.began_ns))
        return is_there


class Playing:
    """One stimulus being played; its clock starts with the first match.

    A subclass in a module of this package says with :func:`plays` what it plays. It is created
    with its order, which is the stimulus with its values, and with the context of the run.
    """

    answer: str | None = None
    """Topic on which answers to what it publishes are expected."""

    topic: str | None = None
    """Topic on which a subscription of the student's counts as the first match."""

    server: str | None = None
    """Service of the probe of which a client of the student's counts as the first match."""

    last_ns: int | None = None
    """When it last published something, if there is an end to that."""

    asks = False
    """Whether it needs a service or an action of the student's, and no topic."""

    def __init__(self, order: Any, context: StimulusContext) -> None:
        self._order = order
        self._context = context

    def tick(self, elapsed_s: float | None) -> None:
        """Do what is due; called with the seconds since the first match, or None before it."""
        if elapsed_s is not None and elapsed_s >= getattr(self._order, "after", 0.0):
            self.play(elapsed_s)

    def play(self, elapsed_s: float) -> None:
        """Do what is due; called again and again from its time on."""

    def finish(self) -> None:
        """The observation is over: note what could not be played."""

    @property
    def due_s(self) -> float | None:
        """When the next call of :meth:`tick` should come at the latest, on its clock."""
        return None

    @property
    def is_done(self) -> bool:
        """Whether it was played; one without an end never keeps a run from ending."""
        return True

    @property
    def keeps_run(self) -> bool:
        """Whether the run goes on although no process of the student's runs any more."""
        return False


PLAYS: dict[type[StimulusModel], type[Playing]] = {}
"""Model of a stimulus -> class that plays it."""


def plays(*models: type[StimulusModel]) -> Callable[[type[P]], type[P]]:
    """Decorator: register a class as the one that plays these stimuli."""

    def register(playing: type[P]) -> type[P]:
        PLAYS.update(dict.fromkeys(models, playing))
        return playing

    return register
