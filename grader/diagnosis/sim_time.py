"""A clock that stands still, because a node waits for simulated time that nobody publishes."""

from __future__ import annotations

from grader.checks.finding import Evidence
from grader.checks.first_seen import endpoints_seen
from grader.checks.wording import code, listing
from grader.diagnosis.cause import Cause
from grader.measure import declarations
from grader.recording.model import Kind, Recording
from grader.spec.unit import format_duration

_CLOCK = "/clock"


def why_time_stands_still(recording: Recording, what: str) -> Cause | None:
    """Timers that never fire, because the time of their node is that of a silent topic.

    A node subscribes to ``/clock`` if its parameter ``use_sim_time`` is true, and only then (see
    "Clock and Time" in the design documents of ROS 2).
    """
    listeners = recording.student_endpoints(Kind.SUBSCRIPTION, _CLOCK)
    told = any(item.topic == _CLOCK and item.kind is Kind.PUBLISHER for item in recording.endpoints)
    timers = declarations.timers(recording)
    if told or not listeners or not timers:
        return None
    periods = listing(format_duration(timer.period_s) for timer in timers)
    return Cause(
        f"{what}: the node takes its time from {code(_CLOCK)} ({code('use_sim_time')} is true), "
        f"which nothing publishes here, so its timer of {periods} never fires",
        f"Leave {code('use_sim_time')} as it is, in the code and in launch files: it is for a "
        "simulator that publishes its own time.",
        Evidence(moments=endpoints_seen(recording, listeners)),
    )
