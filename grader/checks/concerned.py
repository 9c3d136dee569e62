"""Which of the student's nodes a scenario is about."""

from __future__ import annotations

from grader.recording.model import Node, Owner, Recording


def concerned_nodes(recording: Recording) -> tuple[Node, ...]:
    """The student's nodes that publish or subscribe on a topic of the probe's.

    A program may have more nodes, such as one that only reads parameters and is destroyed
    again, or that nobody spins; what becomes of those is its own affair.

    Args:
        recording: The run.

    Returns:
        In the order of their appearance; empty if no node has such an endpoint.
    """
    topics = {item.topic for item in recording.endpoints if item.owner is Owner.PROBE}
    names = {
        item.node
        for item in recording.endpoints
        if item.owner is Owner.STUDENT and item.topic in topics
    }
    return tuple(node for node in recording.student_nodes if node.name in names)
