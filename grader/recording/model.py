"""The model of a recording: what was observed in one run of one scenario, nothing judged.

Times are integer nanoseconds since the Unix epoch on the clock of the machine that ran the
cell, the clock that DDS stamps messages with. Names are fully qualified (``/bot/cmd_vel``).
"""

from __future__ import annotations

import dataclasses
import json
import re
from bisect import bisect_left
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from operator import attrgetter
from typing import Any

from grader.recording.event import Breach, Disturbance, Intervention, Pause, Wait
from grader.recording.interaction import Asked, Goal, Service
from grader.recording.simulated import Incident, Scene, Truth, TurtleEvent
from grader.recording.submission import SubmissionRecord
from grader.spec.names import NO_NAMES, Names

NS = 1_000_000_000
PROBE_NODE = "rosgrade_probe"
"""Name of the node through which a run is watched."""
BAG, BAG_NOTES, BAG_RECEIVED = "bag", "bag_notes", "bag_received"
BAG_RENAMED = "bag_renamed"
"""Keys of ``Recording.environment``, where a bag was read in place of a run."""
OF_ROS = re.compile(r"/(.*/)?(_.*|launch_ros_\d+|transform_listener_impl_[0-9a-f]+)")
"""Nodes of `ros2 launch` itself, what commands of ros2 hide, and a TransformListener's in C++."""


class Owner(str, Enum):
    """Whose a node or an endpoint is."""

    STUDENT = "student"
    PROBE = "probe"
    COMPANION = "companion"
    """A program of the author's."""
    FOREIGN = "foreign"


class Kind(str, Enum):
    """Which end of a topic an endpoint is."""

    PUBLISHER = "publisher"
    SUBSCRIPTION = "subscription"


class Ending(str, Enum):
    """Why the observation of a scenario ended."""

    UNTIL = "until"
    """The scenario's ``until`` was met."""
    TIMEOUT = "timeout"
    """The scenario's ``timeout`` passed first."""
    EXITED = "exited"
    """Every process of the student had ended."""
    NO_NODE = "no_node"
    """No node of the student appeared within the discovery limit."""
    NO_MATCH = "no_match"
    """Nodes appeared, but no endpoint on a topic that is recorded or that a stimulus uses."""
    NOT_STARTED = "not_started"
    """Nothing could be launched: the executable does not exist."""
    FAULT = "fault"
    """A fault of rosgrade or of the machine ended it (see ``Recording.faults``)."""


@dataclass(frozen=True)
class Qos:
    """QoS of an endpoint, in the words of the ROS docs; ``unknown`` if DDS does not show it.

    Attributes:
        reliability: ``reliable``, ``best_effort`` or ``unknown``.
        durability: ``volatile``, ``transient_local`` or ``unknown``.
        history: ``keep_last``, ``keep_all`` or ``unknown`` (not discovered over DDS).
        depth: Queue depth, or None where unknown.
        deadline_s: None for infinite.
        lifespan_s: None for infinite.
        liveliness: ``automatic``, ``manual_by_topic`` or ``unknown``.
        liveliness_lease_s: None for infinite.
    """

    reliability: str = "unknown"
    durability: str = "unknown"
    history: str = "unknown"
    depth: int | None = None
    deadline_s: float | None = None
    lifespan_s: float | None = None
    liveliness: str = "unknown"
    liveliness_lease_s: float | None = None


@dataclass(frozen=True)
class Node:
    """A node seen in the graph.

    Attributes:
        name: Fully qualified, such as ``/bot_publisher``.
        owner: Whose it is: the student's, the probe's, ...
        appeared_ns: First time it was seen.
        vanished_ns: First time it was missing again, or None.
    """

    name: str
    owner: Owner
    appeared_ns: int
    vanished_ns: int | None = None


@dataclass(frozen=True)
class Endpoint:
    """A publisher or subscription seen in the graph.

    Attributes:
        kind: Which end.
        topic: Fully qualified topic name.
        type: Interface name, such as ``geometry_msgs/msg/Twist``.
        node: Fully qualified node name.
        owner: Whose it is: the student's, the probe's, ...
        qos: As discovered.
        gid: DDS identifier as hex.
        type_hash: Hash of the interface's definition (REP-2011); empty if unknown.
        appeared_ns: First time it was seen.
        vanished_ns: First time it was missing again, or None.
        kept: Largest number of messages that a reliable publisher kept at one time, from its
            heartbeats (DDSI-RTPS); None without heartbeats.
        heartbeats: Number of heartbeats with a new newest message.
    """

    kind: Kind
    topic: str
    type: str
    node: str
    owner: Owner
    qos: Qos
    gid: str
    appeared_ns: int
    vanished_ns: int | None = None
    type_hash: str = ""
    kept: int | None = None
    heartbeats: int = 0


@dataclass(frozen=True)
class Message:
    """A message as the probe received it.

    Attributes:
        topic: Fully qualified topic name.
        type: Interface name.
        value: Fields by name; nested messages are mappings, arrays are lists.
        stamp_ns: Source timestamp: when the writer published it.
        received_ns: When the probe's reader had it.
        sequence: The writer's sequence number, from 1.
    """

    topic: str
    type: str
    value: Mapping[str, Any]
    stamp_ns: int
    received_ns: int
    sequence: int


@dataclass(frozen=True)
class Process:
    """One launched process of the student.

    Attributes:
        name: ``package/executable``.
        pid: Process id on the host.
        started_ns: When it was started.
        exited_ns: When it had ended, or None if it could not be ended at all.
        exit_code: As in :mod:`subprocess`: negative for the signal that ended it.
        stopped_by: ``itself``, or the last signal that rosgrade had to send: ``SIGINT``, ...
        stop_s: Seconds from SIGINT to its end, minus delays of the machine; None if it ended
            before.
        survivors: Commands of its descendant processes that had to be killed after it.
        dropped_bytes: Bytes of output beyond what was kept.
    """

    name: str
    pid: int
    started_ns: int
    exited_ns: int | None = None
    exit_code: int | None = None
    stopped_by: str = "itself"
    stop_s: float | None = None
    survivors: tuple[str, ...] = ()
    dropped_bytes: int = 0


@dataclass(frozen=True)
class LogLine:
    """A line that a process wrote, or a message on /rosout.

    Attributes:
        time_ns: When it was read (for rosout: the stamp in the message).
        process: ``package/executable``, or the logger's name for rosout.
        stream: ``stdout``, ``stderr`` or ``rosout``.
        text: Without the line end; undecodable bytes are replaced.
        level: For rosout ``DEBUG``, ``INFO``, ``WARN``, ``ERROR`` or ``FATAL``; else empty.
    """

    time_ns: int
    process: str
    stream: str
    text: str
    level: str = ""


@dataclass(frozen=True)
class Declaration:
    """Something that the tracer in the student's process reported.

    It is *declared by the process* and used only if nothing on the network shows it.

    Attributes:
        time_ns: When the probe read it.
        process: ``package/executable``.
        kind: ``started``, ``node``, ``publisher``, ``subscription``, ``timer``, ``spin``,
            ``executor``, ``callback_group``, ``held`` (a publisher waited for its match),
            ``destroyed`` (a publisher or subscription),
            ``exiting`` (Python ends in its usual way), ``foreign`` (another than the tracer
            wrote to the tracer's pipe).
        data: Of a publisher or subscription its node, topic, type, QoS, number and group; of
            a timer its node, period_s, callback and group; of a spin its executor and threads;
            of a held publisher its topic, waited_s and matched.
    """

    time_ns: int
    process: str
    kind: str
    data: Mapping[str, Any]


@dataclass(frozen=True)
class Call:
    """A service call by the probe.

    Attributes:
        service: Fully qualified service name.
        type: Interface name.
        requested_ns: When the request was sent.
        answered_ns: When the answer was there, or None if there was none by the end.
        request: Its fields; of the calls to ``list_parameters`` they are not kept.
        response: Its fields, or None.
        error: Why it could not be sent or read: ``no server``, or what went wrong in rosgrade.
        servers: How many nodes offered the service then.
    """

    service: str
    type: str
    requested_ns: int
    answered_ns: int | None = None
    request: Mapping[str, Any] | None = None
    response: Mapping[str, Any] | None = None
    error: str = ""
    servers: int = 1


@dataclass(frozen=True)
class Join:
    """A subscription of the probe that was created in the middle of the run.

    Attributes:
        name: What its messages are recorded under.
        topic: Fully qualified topic name.
        type: Interface name.
        qos: As requested.
        joined_ns: When it was created.
        matched_ns: When a publisher had matched it, or None.
    """

    name: str
    topic: str
    type: str
    qos: Qos
    joined_ns: int
    matched_ns: int | None = None


@dataclass(frozen=True)
class Recording:
    """Everything observed in one run of one scenario.

    Attributes:
        scenario: Its id.
        seed: Seed of its random values.
        ending: Why the observation ended.
        launched_ns: When the student's first process was started.
        matched_ns: When the first endpoint of the student on a recorded topic was matched.
        stop_ns: When the observation ended and SIGINT was sent, if no pause came between.
        end_ns: When everything had ended.
        submission: Facts about the submission from before the run.
        messages: By topic, in the order of their source timestamps.
        sent: What the probe published, by topic, in that order; none where no subscription of
            the student's ever matched.
        answers: Topic in ``sent`` -> topic on which the scenario expects the answers.
        joined: What late joiners received, by their names, in the order of their reception.
        unreadable: Topic -> how many messages on it hold other bytes than its type has.
        nodes: Nodes that were seen in the graph, in the order of their appearance.
        endpoints: Publishers and subscriptions, in the order of their appearance.
        processes: The student's processes, in the order of `launch`.
        log: Their output and log records, line by line.
        declarations: Reports of the tracer in the student's processes.
        calls: Calls of services by the probe, in order.
        services: Services that the student's nodes offer.
        clients: Services that the student's nodes have clients of.
        asked: What the student's clients asked of servers of the scenario, in order.
        goals: Goals that the probe sent.
        waits: Waits of the probe with their limits.
        joins: Late joiners.
        pauses: The pause of the executors after the observation, if there was one.
        interventions: What the probe did to the student's processes.
        breaches: Limits of the sandbox that were reached.
        disturbance: Delays of the machine, sample by sample.
        faults: Faults of rosgrade or of the machine, one sentence each.
        truth: The simulated robots, step by step; empty in a scenario without a world.
        incidents: What the simulator noted.
        scenes: World and robot by the name of the robot, which is empty for the only one.
        turtles: What happened to the turtles of the scenario besides their motion, in order.
        values: Values of the scenario by name, fixed and random ones, in SI units.
        environment: ``ros_distro``, ``rmw``, ``python``, ``domain_id``, ``sandbox``, ...; the
            ``ros_imports`` that are installed; the ``parameters`` of the launch, by name;
            ``other_domains`` that the student joined;
            ``compiled_tracer``: ``preloaded``, ``lacking``, or ``none`` where nothing is compiled.
            Where a bag was read in place of a run, its folder (``bag``), what is conspicuous about
            it (``bag_notes``), and ``bag_received`` where its times are those of the recorder.
        names: Wrong names of the student that were put right in this run.
    """

    scenario: str
    seed: int
    ending: Ending
    launched_ns: int
    stop_ns: int
    end_ns: int
    submission: SubmissionRecord
    matched_ns: int | None = None
    messages: Mapping[str, tuple[Message, ...]] = field(default_factory=dict)
    sent: Mapping[str, tuple[Message, ...]] = field(default_factory=dict)
    answers: Mapping[str, str] = field(default_factory=dict)
    joined: Mapping[str, tuple[Message, ...]] = field(default_factory=dict)
    unreadable: Mapping[str, int] = field(default_factory=dict)
    nodes: tuple[Node, ...] = ()
    endpoints: tuple[Endpoint, ...] = ()
    processes: tuple[Process, ...] = ()
    log: tuple[LogLine, ...] = ()
    declarations: tuple[Declaration, ...] = ()
    calls: tuple[Call, ...] = ()
    services: tuple[Service, ...] = ()
    clients: tuple[Service, ...] = ()
    asked: tuple[Asked, ...] = ()
    goals: tuple[Goal, ...] = ()
    waits: tuple[Wait, ...] = ()
    joins: tuple[Join, ...] = ()
    pauses: tuple[Pause, ...] = ()
    interventions: tuple[Intervention, ...] = ()
    breaches: tuple[Breach, ...] = ()
    disturbance: tuple[Disturbance, ...] = ()
    faults: tuple[str, ...] = ()
    truth: tuple[Truth, ...] = ()
    incidents: tuple[Incident, ...] = ()
    scenes: Mapping[str, Scene] = field(default_factory=dict)
    turtles: tuple[TurtleEvent, ...] = ()
    values: Mapping[str, float] = field(default_factory=dict)
    environment: Mapping[str, str] = field(default_factory=dict)
    names: Names = NO_NAMES

    @property
    def scene(self) -> Scene | None:
        """World and robot, where there is just one robot."""
        return next(iter(self.scenes.values())) if len(self.scenes) == 1 else None

    @property
    def robot(self) -> str:
        """Name of the robot, where there is just one: empty, if it was alone."""
        return next(iter(self.scenes)) if len(self.scenes) == 1 else ""

    @property
    def given_parameters(self) -> tuple[str, ...]:
        """Names of the parameters that the scenario launches its programs with."""
        return tuple(self.environment.get("parameters", "").split())

    @property
    def bag(self) -> str | None:
        """Folder of the bag that was read; None for a run."""
        return self.environment.get(BAG)

    @property
    def bag_notes(self) -> tuple[str, ...]:
        """What is conspicuous about that bag, parts of a sentence."""
        return tuple(self.environment.get(BAG_NOTES, "").splitlines())

    def in_bag(self, topic: str) -> str:
        """What a topic is called in that bag."""
        rules = (rule.split(":=") for rule in self.environment.get(BAG_RENAMED, "").split())
        return next((own for own, asked in rules if asked == topic), topic)

    def on(self, topic: str) -> tuple[Message, ...]:
        """Messages on a topic, oldest first."""
        return self.messages.get(topic, ())

    def carried(self, topic: str) -> tuple[Message, ...]:
        """Messages that a subscription to the topic could get: recorded, or sent by the probe."""
        return self.on(topic) or self.sent.get(topic, ())

    def asked_of(self, server: str) -> tuple[Asked, ...]:
        """What the student's clients asked of a server of the scenario, in order."""
        return tuple(one for one in self.asked if one.server == server)

    @cached_property
    def student_nodes(self) -> tuple[Node, ...]:
        """The student's nodes, in the order of their appearance."""
        return tuple(node for node in self.nodes if node.owner is Owner.STUDENT)

    @cached_property
    def written_nodes(self) -> tuple[Node, ...]:
        """The student's nodes but those that ROS makes by itself; all if there are no others."""
        there = self.student_nodes
        return tuple(node for node in there if not OF_ROS.fullmatch(node.name)) or there

    def student_endpoints(self, kind: Kind, topic: str | None = None) -> tuple[Endpoint, ...]:
        """The student's endpoints of a kind, on one topic or on all."""
        return tuple(
            endpoint
            for endpoint in self.endpoints
            if endpoint.owner is Owner.STUDENT
            and endpoint.kind is kind
            and topic in (None, endpoint.topic)
        )

    def misdefined(self, topic: str) -> bool:
        """Whether the student publishes another definition of the type that the probe reads."""
        ends = [item for item in self.endpoints if item.topic == topic and item.type_hash]
        read = {(e.type, e.type_hash) for e in ends if e.owner is Owner.PROBE}
        theirs = (e for e in ends if e.owner is Owner.STUDENT and e.kind is Kind.PUBLISHER)
        types = {name for name, _ in read}
        return any(e.type in types and (e.type, e.type_hash) not in read for e in theirs)

    def declared(self, kind: str) -> tuple[Declaration, ...]:
        """Declarations of a kind."""
        return tuple(item for item in self.declarations if item.kind == kind)

    def since_launch_s(self, time_ns: int) -> float:
        """Seconds from launch to a time."""
        return (time_ns - self.launched_ns) / NS

    def stolen_s(self, begin_ns: int, end_ns: int) -> float:
        """Upper bound of the delay by the machine in ``[begin_ns, end_ns]``, in s.

        The sum of the student's waits for a CPU and the worst lateness of the metronome, over
        all samples that overlap the interval.
        """
        # The first sample after the beginning covers it; the first after the end is the last.
        first = bisect_left(self.disturbance, begin_ns, key=attrgetter("time_ns"))
        last = bisect_left(self.disturbance, end_ns, key=attrgetter("time_ns"))
        samples = self.disturbance[first : last + 1]
        waited = sum(sample.waited_ns for sample in samples)
        late = max((sample.late_ns for sample in samples), default=0)
        return (waited + late) / NS

    def own_end_ns(self, begin_ns: int, own_s: float) -> int:
        """When a program had so much time after ``begin_ns``, at the latest: without delays."""
        return begin_ns + self._stretched_ns(own_s, lambda long_ns: (begin_ns, begin_ns + long_ns))

    def own_begin_ns(self, end_ns: int, own_s: float) -> int:
        """Since when a program had so much time before ``end_ns``, at the earliest."""
        return end_ns - self._stretched_ns(own_s, lambda long_ns: (end_ns - long_ns, end_ns))

    def _stretched_ns(self, own_s: float, interval: Callable[[int], tuple[int, int]]) -> int:
        """How long it lasts at most, with what the machine took in all of that time."""
        before_ns, long_ns = -1, round(own_s * NS)
        while long_ns > before_ns:
            before_ns = long_ns
            long_ns = round((own_s + self.stolen_s(*interval(long_ns))) * NS)
        return long_ns


def to_json(fact: Any) -> bytes:
    """A dataclass of the model, or a list of them, as compact JSON."""
    return json.dumps(fact, default=_fields, separators=(",", ":"), sort_keys=True).encode()


def _fields(fact: Any) -> dict[str, Any]:
    return {field.name: getattr(fact, field.name) for field in dataclasses.fields(fact)}
