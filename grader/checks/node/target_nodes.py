"""Which of the student's nodes a scenario is about."""

from __future__ import annotations

from grader.recording.model import Node, Owner, Recording


def target_nodes(recording: Recording) -> tuple[Node, ...]:
    """The student's nodes that publish what the probe subscribes to, or subscribe to what it sends.

    A program may have more nodes, such as one that only reads parameters or listens to another
    node of the program, and is destroyed again or never spun; what becomes of those is its own
    affair.

    Returns:
        In the order of their appearance; empty if no node has such an endpoint.
    """
    ends = {(item.kind, item.topic) for item in recording.endpoints if item.owner is Owner.PROBE}
    names = {
        item.node
        for item in recording.endpoints
        if item.owner is Owner.STUDENT
        and any(kind is not item.kind and topic == item.topic for kind, topic in ends)
    }
    return tuple(node for node in recording.student_nodes if node.name in names)
