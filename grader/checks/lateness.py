"""What the machine took from a run with a simulated robot."""

from __future__ import annotations

from grader.recording.model import NS, Recording

# Late steps are noted before they are done, at the stamp of the step before them.
_MARGIN_NS = 20_000_000
# As long as a timer of 10 Hz makes a command wait anyway; tolerances are made for that.
_STALL_S = 0.1
_STALL_WINDOW_NS = NS // 2


def taken_s(recording: Recording, begin_ns: int, end_ns: int) -> float:
    """How much later than without the machine's doing the robot can have got a command, at most.

    The student's waits for a CPU and the probe's lateness, and how late the simulator itself
    was with its sensors' messages.

    Args:
        recording: The run.
        begin_ns: Beginning of the interval.
        end_ns: Its end.
    """
    late_s = [
        item.value or 0.0
        for item in recording.incidents
        if item.kind == "late" and begin_ns - _MARGIN_NS <= item.time_ns <= end_ns
    ]
    return recording.taken_s(begin_ns, max(begin_ns, end_ns)) + max(late_s, default=0.0)


def was_out_of_hand(recording: Recording) -> bool:
    """Whether the machine kept the student from steering for a while at one time.

    A control loop that is held up goes another way from there on, by how much nobody can tell:
    what fails then is worth a second run. Many short waits do not add up to that.
    """
    if not recording.truth:
        return False
    begin_ns, end_ns = recording.truth[0].time_ns, recording.truth[-1].time_ns
    return any(
        taken_s(recording, item.time_ns, item.time_ns + _STALL_WINDOW_NS) > _STALL_S
        for item in recording.disturbance
        if begin_ns <= item.time_ns <= end_ns and item.waited_ns + item.late_ns
    )
