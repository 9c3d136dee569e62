"""Endpoints that the student's code destroyed although its process ran on."""

from __future__ import annotations

from grader.diagnosis.cause import Cause
from grader.diagnosis.process.process_exit import ended_early, exited
from grader.findings.finding import Evidence, Moment
from grader.findings.wording import code
from grader.measure import declarations
from grader.recording.model import Endpoint, Kind, Recording

_HINT = (
    "Keep it and its node until rclpy.spin() returns. Look for destroy_publisher(), "
    "destroy_subscription(), destroy_service(), destroy() and destroy_node(), and for a node that "
    "is stored only in a local variable of a function that returns."
)


def why_unsubscribed(
    recording: Recording, topic: str, seen: str, sent_ns: int | None = None
) -> Cause | None:
    """The cause if the student's code destroyed its subscriptions to a topic, or None.

    Args:
        sent_ns: When something was sent that they did not get; by default any time will do.
    """
    subscriptions = recording.student_endpoints(Kind.SUBSCRIPTION, topic)
    if sent_ns is not None and any((item.vanished_ns or 0) > sent_ns for item in subscriptions):
        return None
    return _why_destroyed(recording, seen, f"the subscription to {code(topic)}", subscriptions)


def why_unpublished(recording: Recording, topic: str, seen: str) -> Cause | None:
    """The same of its publishers on a topic."""
    publishers = recording.student_endpoints(Kind.PUBLISHER, topic)
    return _why_destroyed(recording, seen, f"the publisher on {code(topic)}", publishers)


def _why_destroyed(
    recording: Recording, seen: str, what: str, found: tuple[Endpoint, ...]
) -> Cause | None:
    """The cause if the student's code destroyed all of some endpoints.

    What vanished with its process, or because the scenario ended that, was not destroyed.
    """
    ends = [item.vanished_ns for item in found if item.vanished_ns is not None]
    if not found or len(ends) < len(found):
        return None
    last_ns = max(ends)
    for item in found:
        process = declarations.process_of(recording, item.node)
        if ended_early(recording, process) if process is not None else exited(recording):
            return None
        if any(
            done.time_ns <= last_ns and (process is None or process.name == done.process)
            for done in recording.interventions
        ):
            return None
    when_s = recording.since_launch_s(last_ns)
    return Cause(
        f"{seen}: {what} was destroyed {when_s:.2f} s after launch, while the process still ran",
        _HINT,
        Evidence(moments=(Moment(f"{what.replace('`', '')} was destroyed", when_s),)),
    )
