"""Checks of topics: who publishes and subscribes, with which type."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from pydantic import Field

from grader.checks.check import Parameters, Subject, check
from grader.checks.finding import Evidence, Finding, Moment, Status
from grader.checks.need import Recorded
from grader.checks.wording import code, codes
from grader.diagnosis.explanation import explain
from grader.diagnosis.no_endpoint import misnamed, why_no_endpoint
from grader.diagnosis.type_confusion import OtherType
from grader.recording.model import Endpoint, Kind, Recording
from grader.spec.name import InterfaceName, TopicName


class _Named(Parameters):
    topic: TopicName = Field(description="Fully qualified topic name.")
    remap: bool = Field(
        False,
        description="If the node uses the right type on a topic that the assignment does not name, "
        "run again with that topic remapped to this one. This check fails, and the checks that "
        "require it are judged in the second run: a wrong name costs the points of one check.",
    )


class Topic(_Named):
    """Parameters of topic.published and topic.subscribed."""


@check("topic.published", Subject.RECORDING, Topic)
def published(recording: Recording, parameters: Topic) -> Finding:
    """The node publishes on the topic.

    Judged by the ROS graph: a publisher of the student's was there. Whether and what it
    publishes is judged elsewhere.
    """
    return _presence(recording, Kind.PUBLISHER, parameters)


@check("topic.subscribed", Subject.RECORDING, Topic)
def subscribed(recording: Recording, parameters: Topic) -> Finding:
    """The node subscribes to the topic.

    Judged by the ROS graph: a subscription of the student's was there.
    """
    return _presence(recording, Kind.SUBSCRIPTION, parameters)


def _presence(recording: Recording, kind: Kind, parameters: Topic) -> Finding:
    topic = parameters.topic
    expected = f"a {kind.value} on {code(topic)}"
    finding = _absence(recording, kind, parameters, expected)
    if finding is not None:
        return finding
    endpoints = recording.student_endpoints(kind, topic)
    if not endpoints:
        return Finding.passed(expected, "messages came from one, too short-lived for the graph")
    first = min(endpoints, key=lambda item: item.appeared_ns)
    when_s = recording.since_launch_s(first.appeared_ns)
    return Finding.passed(
        expected,
        f"{codes(sorted({item.node for item in endpoints}))} has one, seen {when_s:.2f} s after "
        "launch",
        Evidence(moments=(Moment(f"{kind.value} on {topic} appeared", when_s),)),
    )


def _absence(
    recording: Recording, kind: Kind, parameters: Topic | Type, expected: str
) -> Finding | None:
    """The finding of an endpoint that is not there, or only under another name."""
    cause = why_no_endpoint(recording, kind, parameters.topic)
    if cause is not None:
        finding = cause.finding(expected)
        remap = misnamed(recording, kind, parameters.topic) if parameters.remap else ""
        return replace(finding, remap=remap) if finding.status is Status.FAILED else finding
    for remap in recording.remaps:
        found, _, name = remap.partition(":=")
        if parameters.remap and name == parameters.topic:
            return replace(
                Finding.failed(
                    expected,
                    f"one on {code(found)} instead; everything else was judged in a run with "
                    f"`--ros-args -r {remap}`, which puts the name right",
                    f"Write the topic's name as '{name.lstrip('/')}'.",
                    Evidence(moments=_moments(recording, recording.student_endpoints(kind, name))),
                ),
                remap=remap,
            )
    return None


class Type(_Named):
    """Parameters of topic.type."""

    needs = (Recorded(type="type", kind="kind"),)

    type: InterfaceName = Field(description="Interface, such as geometry_msgs/msg/Twist.")
    kind: Literal["publisher", "subscription"] = Field(
        "publisher", description="Which end of the student's to judge."
    )


@check("topic.type", Subject.RECORDING, Type)
def type_(recording: Recording, parameters: Type) -> Finding:
    """The topic has the expected message type.

    Judged by the ROS graph, for every endpoint of the student's on the topic.
    """
    kind = Kind(parameters.kind)
    expected = f"a {kind.value} of {code(parameters.type)} on {code(parameters.topic)}"
    finding = _absence(recording, kind, parameters, expected)
    if finding is not None:
        return finding
    types = _types(recording, kind, parameters.topic)
    wrong = [name for name in types if name != parameters.type]
    if not wrong:
        return Finding.passed(expected, f"the type is {codes(types)}")
    places = recording.student_endpoints(kind, parameters.topic)
    observed = f"the {kind.value} has the type {code(wrong[0])}"
    if parameters.type in types:
        observed = f"another {kind.value} on the topic has the type {code(wrong[0])}"
    explanation = explain(OtherType(parameters.type, wrong[0]))
    package, _, short = parameters.type.split("/")
    return Finding.failed(
        expected,
        f"{observed}: {explanation}" if explanation else observed,
        f"A publisher and a subscription meet only if their types are the same: "
        f"`from {package}.msg import {short}`.",
        Evidence(moments=_moments(recording, places)),
    )


def _types(recording: Recording, kind: Kind, topic: str) -> list[str]:
    found = [item.type for item in recording.student_endpoints(kind, topic)]
    if not found:
        found = [message.type for message in recording.on(topic)[:1]]
    return sorted(set(found))


def _moments(recording: Recording, endpoints: tuple[Endpoint, ...]) -> tuple[Moment, ...]:
    return tuple(
        Moment(f"{item.type} on {item.topic}", recording.since_launch_s(item.appeared_ns))
        for item in endpoints[:5]
    )
