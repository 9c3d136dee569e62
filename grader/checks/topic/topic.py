"""Checks of topics: who publishes and subscribes, with which type, and not in the robot's name."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from pydantic import Field

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.checks.need import Recorded
from grader.checks.wrong_name import Named, misnamed
from grader.diagnosis.destroyed_endpoint import why_dropped
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.no_endpoint import ENDPOINTS, meant_endpoint, why_no_endpoint
from grader.diagnosis.no_node import why_no_node, why_not_node
from grader.findings.finding import Evidence, Finding, endpoints_seen, nodes_seen
from grader.findings.words import code, codes, type_in_code
from grader.recording.model import PROBE_NODE, Kind, Recording
from grader.spec.name import InterfaceName, QualifiedNodeName, TopicName
from grader.spec.names import Thing


class Topic(Named):
    """Part of the parameters of the checks of one topic."""

    thing, called = Thing.TOPIC, "{self.topic}"

    topic: TopicName = Field(description="Fully qualified topic name.")


class Published(Topic):
    """Parameters of topic.published."""

    of_bags = True
    asks = "a publisher on `{self.topic}`"


@check("topic.published", Subject.RECORDING, Published, concept="names")
def published(recording: Recording, parameters: Published) -> Finding:
    """The node publishes on the topic.

    Judged by the ROS graph: the student's node had a publisher, and not only in its constructor.
    Other checks judge its messages.
    """
    return _presence(recording, Kind.PUBLISHER, parameters)


class Subscribed(Topic):
    """Parameters of topic.subscribed."""

    asks = "a subscription on `{self.topic}`"


@check("topic.subscribed", Subject.RECORDING, Subscribed, concept="names")
def subscribed(recording: Recording, parameters: Subscribed) -> Finding:
    """The node subscribes to the topic.

    Judged by the ROS graph: the student's node had a subscription, and not only in its constructor.
    """
    return _presence(recording, Kind.SUBSCRIPTION, parameters)


def _presence(recording: Recording, kind: Kind, parameters: Topic) -> Finding:
    absent = _absence(recording, kind, parameters)
    if absent is not None:
        return absent
    dropped = why_dropped(recording, kind, parameters.topic)
    if dropped is not None:
        # What it published can be judged.
        heard = kind is Kind.PUBLISHER and bool(recording.on(parameters.topic))
        return replace(dropped, stands_alone=heard)
    endpoints = recording.student_endpoints(kind, parameters.topic)
    if not endpoints:
        seen = "messages came from one, but too briefly for the ROS graph"
        return Finding.as_asked(seen)
    first = min(endpoints, key=lambda item: item.appeared_ns)
    nodes, when_s = {item.node for item in endpoints}, recording.since_launch_s(first.appeared_ns)
    return Finding.as_asked(
        f"{codes(sorted(nodes))} has one, seen {when_s:.2f} s after launch",
        Evidence(moments=endpoints_seen(recording, [first])),
    )


def _absence(recording: Recording, kind: Kind, parameters: Topic) -> Finding | None:
    """The finding of an endpoint that is not there, or only under another name."""
    cause = why_no_endpoint(recording, kind, parameters.topic)
    there = recording.student_endpoints(kind, parameters.topic)
    shown = Evidence(moments=endpoints_seen(recording, there))
    meant = meant_endpoint(recording, ENDPOINTS[kind], parameters.topic)
    return misnamed(recording, parameters, cause, meant, shown)


class NotSubscribed(Parameters):
    """Parameters of topic.not_subscribed."""

    topics: tuple[TopicName, ...] = Field(description="Topics that are not for it.", min_length=1)
    node: QualifiedNodeName | None = Field(
        None, description="Name of the node; by default every node that was launched."
    )

    def _asked(self) -> str:
        whose = f" of {code(self.node)}" if self.node else ""
        return f"no subscription{whose} on {codes(self.topics, last='or')}"


@check("topic.not_subscribed", Subject.RECORDING, NotSubscribed, concept="names")
def not_subscribed(recording: Recording, parameters: NotSubscribed) -> Finding:
    """The node does not subscribe to the topics.

    Judged by the ROS graph, such as for a layer that must not read a sensor itself.
    """
    name = parameters.node
    stop_if(why_not_node(recording, name) if name else why_no_node(recording))
    for endpoint in recording.student_endpoints(Kind.SUBSCRIPTION):
        if endpoint.topic in parameters.topics and name in (None, endpoint.node):
            return mistaken(
                "not_its_topic",
                f"the node {code(endpoint.node)} subscribes to {code(endpoint.topic)}",
                Evidence(moments=endpoints_seen(recording, [endpoint])),
            )
    return Finding.as_asked("none")


class Type(Topic):
    """Parameters of topic.type."""

    asks = "a {self.kind} of `{self.type}` on `{self.topic}`"
    needs = (Recorded(type="type", kind="kind"),)

    type: InterfaceName = Field(description="Interface, such as geometry_msgs/msg/Twist.")
    kind: Literal["publisher", "subscription"] = Field(
        "publisher", description="Which endpoint of the student to judge."
    )

    @property
    def judges_bags(self) -> bool:
        """Whether it is about what was recorded."""
        return self.kind == "publisher"


@check("topic.type", Subject.RECORDING, Type, concept="interfaces")
def type_(recording: Recording, parameters: Type) -> Finding:
    """The topic has the expected message type.

    Judged by the ROS graph, for every endpoint of the student's nodes on the topic.
    """
    kind, topic, wanted = Kind(parameters.kind), parameters.topic, parameters.type
    absent = _absence(recording, kind, parameters)
    if absent is not None:
        return absent
    endpoints = recording.student_endpoints(kind, topic)
    types = sorted({item.type for item in endpoints or recording.on(topic)[:1]})
    wrong = [name for name in types if name != wanted]
    if not wrong:
        return Finding.as_asked(f"the type is {codes(types)}")
    which = f"another {kind.value} on the topic" if wanted in types else f"the {kind.value}"
    shown = Evidence(moments=endpoints_seen(recording, endpoints))
    seen = f"{which} has the type {code(wrong[0])}"
    return mistaken("other_topic_type", seen, shown, type=code(type_in_code(wanted)))


class Untouched(Parameters):
    """Parameters of topic.untouched."""

    topics: tuple[TopicName, ...] = Field(
        ("/odom", "/scan", "/clock", "/tf", "/tf_static"),
        description="Topics that belong to the robot.",
    )

    def _asked(self) -> str:
        return f"no publisher on {codes(self.topics, last='or')}"


@check("topic.untouched", Subject.RECORDING, Untouched, concept="names")
def untouched(recording: Recording, parameters: Untouched) -> Finding:
    """Only the robot publishes its sensors.

    Judged by the ROS graph: no node of the student has a publisher on a topic of the robot, or the
    name of the probe. The simulator itself judges motion, so publishing there would bring no
    points.
    """
    stop_if(why_no_node(recording))
    for endpoint in recording.student_endpoints(Kind.PUBLISHER):
        if endpoint.topic in parameters.topics:
            return mistaken(
                "robots_topic",
                f"the node {code(endpoint.node)} publishes on {code(endpoint.topic)}, which "
                "belongs to the robot",
                Evidence(moments=endpoints_seen(recording, [endpoint])),
            )
    for node in recording.student_nodes:
        if node.name.rpartition("/")[2] == PROBE_NODE:
            return mistaken(
                "probes_name",
                f"a node of the submission is called {code(node.name)}, which is the name of the "
                "node that watches the run",
                Evidence(moments=nodes_seen(recording)),
            )
    return Finding.as_asked("none")
