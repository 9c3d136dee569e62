"""What the machine took from a run with a simulated robot."""

from __future__ import annotations

from grader.recording.model import Recording

# Late steps are noted before they are done, at the stamp of the step before them.
_MARGIN_NS = 20_000_000


def stolen_s(recording: Recording, begin_ns: int, end_ns: int) -> float:
    """How much later than without the machine's doing the robot can have got a command, at most.

    The student's waits for a CPU and the probe's lateness, and how late the simulator itself
    was with its sensors' messages.
    """
    late_s = [
        item.value or 0.0
        for item in recording.incidents
        if item.kind == "late" and begin_ns - _MARGIN_NS <= item.time_ns <= end_ns
    ]
    return recording.stolen_s(begin_ns, max(begin_ns, end_ns)) + max(late_s, default=0.0)
