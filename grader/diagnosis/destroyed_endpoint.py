"""Endpoints that the student's code destroyed although its process ran on."""

from __future__ import annotations

from collections.abc import Iterable

from grader.diagnosis.explanation import remedy
from grader.diagnosis.process.process_exit import ended_early, exited
from grader.findings.finding import Finding, evidence_at
from grader.findings.words import code
from grader.measure import declarations
from grader.recording.interaction import Service, executor_services
from grader.recording.model import NS, Call, Endpoint, Kind, Recording

# A program that is about to end may destroy what it has first.
_LONG_NS = NS


def why_unsubscribed(
    recording: Recording, topic: str, seen: str, sent_ns: int | None = None
) -> Finding | None:
    """The cause if the student's code destroyed its subscriptions to a topic, or None.

    Args:
        sent_ns: When something was sent that they did not get; by default any time will do.
    """
    subscriptions = recording.student_endpoints(Kind.SUBSCRIPTION, topic)
    last_ns = max((item.vanished_ns or 0 for item in subscriptions), default=0)
    if sent_ns is not None and last_ns > sent_ns:
        return None
    return _why_destroyed(recording, seen, f"the subscription to {code(topic)}", subscriptions)


def why_unpublished(recording: Recording, topic: str, seen: str) -> Finding | None:
    """The same of its publishers on a topic."""
    publishers = recording.student_endpoints(Kind.PUBLISHER, topic)
    return _why_destroyed(recording, seen, f"the publisher on {code(topic)}", publishers)


def _why_destroyed(
    recording: Recording, seen: str, what: str, items: tuple[Endpoint | Service, ...]
) -> Finding | None:
    """The cause if the student's code destroyed all of some endpoints.

    What vanished with its process, or because the scenario ended that, was not destroyed.
    """
    vanished_ns = [item.vanished_ns for item in items if item.vanished_ns is not None]
    if not items or len(vanished_ns) < len(items):
        return None
    return _destroyed_at(recording, seen, what, {item.node for item in items}, max(vanished_ns))


def why_dropped(recording: Recording, kind: Kind, topic: str) -> Finding | None:
    """The cause if the student's code lost its endpoints on a topic where it created them.

    What the scenario asks for may make a node create and destroy endpoints, as a lifecycle node.
    """
    last_ns = declarations.dropped_ns(recording, kind, topic)
    if last_ns is None or last_ns > recording.stop_ns - _LONG_NS:
        return None
    created = [one for one in recording.declared(kind.value) if one.data.get("topic") == topic]
    nodes = {str(one.data.get("node")) for one in created}
    calls = _calls_of_scenario(recording, nodes)
    is_asked = any(call.requested_ns < last_ns for call in calls)
    spun_ns = min((one.time_ns for one in recording.declared("spin")), default=last_ns)
    if spun_ns < last_ns and (is_asked or recording.goals or any(recording.sent.values())):
        return None
    what = f"the {kind.value} {'on' if kind is Kind.PUBLISHER else 'to'} {code(topic)}"
    return _destroyed_at(recording, "it was there only for a moment", what, nodes, last_ns)


def why_withdrawn(recording: Recording, what: str, servers: tuple[Service, ...]) -> Finding | None:
    """The cause if the student's code destroyed a server before it answered anything."""
    names = {server.name for server in servers}
    calls = _calls_of_scenario(recording, {server.node for server in servers})
    goals = [goal for goal in recording.goals if goal.action in names]
    if any(call.answered_ns for call in calls) or any(goal.answered_ns for goal in goals):
        return None
    vanished_ns = [server.vanished_ns for server in servers if server.vanished_ns is not None]
    if not vanished_ns or max(vanished_ns) > recording.stop_ns - _LONG_NS:
        return None
    return _why_destroyed(recording, "it was there only for a moment", what, servers)


def _calls_of_scenario(recording: Recording, nodes: Iterable[str]) -> list[Call]:
    """Calls that the scenario asks for, without those by which the probe watches the executors."""
    watching = {name for node in nodes for name in executor_services(node)}
    return [call for call in recording.calls if call.service not in watching]


def _destroyed_at(
    recording: Recording, seen: str, what: str, nodes: set[str], last_ns: int
) -> Finding | None:
    """The cause, unless the process ended itself or the scenario did something to it."""
    for node in nodes:
        process = declarations.process_of(recording, node)
        has_ended = exited(recording) if process is None else ended_early(recording, process)
        done_to_it = [
            intervention
            for intervention in recording.interventions
            if intervention.time_ns <= last_ns
            and (process is None or process.name == intervention.process)
        ]
        if has_ended or done_to_it:
            return None
    when_s = recording.since_launch_s(last_ns)
    return Finding(
        f"{seen}: {what} was destroyed {when_s:.2f} s after launch, while the process still ran",
        remedy("destroyed_endpoint"),
        evidence_at(recording, f"{what.replace('`', '')} was destroyed", last_ns),
        concept="nodes",
    )
