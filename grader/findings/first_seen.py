"""Moments for evidence: when the student's nodes and endpoints were first seen, and the end.

Something that is missing has no time; these moments show what there was instead.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice

from grader.findings.finding import Evidence, Moment, Plot
from grader.recording.model import Endpoint, Message, Recording

_MOST = 5


def nodes_seen(recording: Recording) -> tuple[Moment, ...]:
    """When the student's nodes appeared, the first few."""
    return tuple(
        Moment(f"node {node.name} appeared", recording.since_launch_s(node.appeared_ns))
        for node in recording.student_nodes[:_MOST]
    )


def endpoints_seen(recording: Recording, endpoints: Iterable[Endpoint]) -> tuple[Moment, ...]:
    """When endpoints appeared, the first few."""
    return tuple(
        Moment(
            f"{item.kind.value} on {item.topic} appeared",
            recording.since_launch_s(item.appeared_ns),
        )
        for item in islice(endpoints, _MOST)
    )


def first_seen(recording: Recording, messages: Iterable[Message]) -> tuple[Moment, ...]:
    """When the first of some messages was published; nothing where there is none."""
    return tuple(
        Moment(f"first message on {item.topic}", recording.since_launch_s(item.stamp_ns))
        for item in islice(messages, 1)
    )


def until_the_end(recording: Recording, what: str = "the observation ended") -> Moment:
    """The end of the observation, for what lasted or was missing until then."""
    return Moment(what, recording.since_launch_s(recording.stop_ns))


def evidence_at(recording: Recording, label: str, time_ns: int, *plots: Plot) -> Evidence:
    """A moment of a run, with series to draw."""
    return Evidence(moments=(Moment(label, recording.since_launch_s(time_ns)),), plots=plots)
