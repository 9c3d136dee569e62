"""What an instructor should know of a run although it costs nothing by itself."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator

from grader.checks.topic.topic import PROBE, Untouched
from grader.findings.wording import code, codes, counted
from grader.measure.transforms import TRANSFORMS
from grader.recording.model import NS, Kind, Owner, Recording

_FLOOD = 1000
"""Messages within a second on one topic; the fastest sensors send fewer."""


def remarks(recording: Recording) -> tuple[str, ...]:
    """Say what is conspicuous about a run, one sentence each.

    A limit of the sandbox that was reached is reported elsewhere (``Recording.breaches``).
    """
    names = f"so that everything else could be judged: {codes(map(str, recording.names.wrong))}"
    renamed = (f"this run corrected wrong names, {names}",) if recording.names else ()
    return (*renamed, *_posing(recording), *_excess(recording), *_tricks(recording))


def _posing(recording: Recording) -> Iterator[str]:
    """Names of the probe and topics of the robot, unless the assignment asks for them."""
    for node in recording.student_nodes:
        if node.name.rpartition("/")[2] == PROBE:
            name = code(node.name)
            yield f"a node of the submission is called {name}, like the node that watches the run"
    heard = [e for e in recording.endpoints if e.owner is Owner.PROBE]
    # A robot is not the only one to publish transforms.
    wanted = {e.topic for e in heard if recording.scene is None or e.type == TRANSFORMS}
    taken: dict[str, set[str]] = {}
    for endpoint in recording.student_endpoints(Kind.PUBLISHER):
        if endpoint.topic in set(Untouched().topics) - wanted:
            taken.setdefault(endpoint.node, set()).add(endpoint.topic)
    for node_name, topics in sorted(taken.items()):
        yield f"the node {code(node_name)} publishes on {codes(sorted(topics))}, which robots do"


def _excess(recording: Recording) -> Iterator[str]:
    """Another domain, and more messages or output than a robot needs."""
    others = recording.environment.get("other_domains")
    if others:
        yield f"the submission joined another ROS domain: {others}"
    for topic, messages in recording.messages.items():
        times = [message.stamp_ns for message in messages]
        numbers = [*range(len(messages))]
        if len(recording.student_endpoints(Kind.PUBLISHER, topic)) == 1:
            # A publisher numbers its messages: of a flood most are lost on the way.
            numbers = [message.sequence for message in messages]
        lasts = (bisect_left(times, time + NS) - 1 for time in times)
        most = max((numbers[last] - numbers[i] + 1 for i, last in enumerate(lasts)), default=0)
        if most > _FLOOD:
            yield f"{most} messages were sent on {code(topic)} within 1 s"
    for process in recording.processes:
        if process.dropped_bytes:
            left_out = counted(process.dropped_bytes, "byte")
            yield f"{code(process.name)} printed {left_out} more than rosgrade keeps"


def _tricks(recording: Recording) -> Iterator[str]:
    if not any(breach.what == "forged report" for breach in recording.breaches):
        for process in dict.fromkeys(item.process for item in recording.declared("foreign")):
            yield (
                f"{code(process)} wrote into the channel through which rosgrade reports from "
                "inside a process; such a report is never proof"
            )
    # Such libraries are perhaps missing where a class is graded.
    modules = recording.environment.get("unlisted", "").split()
    if modules:
        has_none = recording.environment.get("sandbox", "none") == "none"
        here = "without a sandbox" if has_none else "in the system's Python, as ROS is sourced"
        yield (
            f"the code imports {codes(modules)}, found {here}: elsewhere, Python has only "
            "the standard library, ROS 2, `numpy`, and what the assignment allows"
        )
