"""What was published while the executors paused after a run: no callback published it."""

from __future__ import annotations

from dataclasses import dataclass

from grader.measure.declarations import destroyed
from grader.recording.model import NS, Declaration, Recording

# A callback that runs when the pause begins may still publish: in the first interval of 2.5.
_GRACE = 0.4


@dataclass(frozen=True)
class Paused:
    """The pause of the processes that publish on a topic.

    Attributes:
        uncalled_ns: When messages came on it although no executor called anything.
    """

    began_ns: int
    ended_ns: int
    uncalled_ns: tuple[int, ...]

    def covers(self, recording: Recording, topic: str) -> bool:
        """Whether it was long enough for a message of what publishes in the rhythm of the run."""
        times_ns = [one.received_ns for one in recording.on(topic)]
        judged_ns = (1.0 - _GRACE) * (self.ended_ns - self.began_ns)
        return judged_ns * max(len(times_ns) - 1, 1) >= max(times_ns) - min(times_ns)

    def is_doubtful(self, recording: Recording) -> bool:
        """Whether the machine may have kept a message for so long that it came too late."""
        lasted_s = (self.ended_ns - self.began_ns) / NS
        return recording.stolen_s(self.began_ns, self.ended_ns) > _GRACE * lasted_s


def paused(recording: Recording, topic: str) -> Paused | None:
    """How the processes with a publisher on a topic paused, or None where one did not."""
    pause = recording.pauses[-1]
    # By name: of a process that was started again, the newest counts.
    publishing = {one.process: _process_of(one) for one in publishers(recording, topic)}
    began_ns = {
        _process_of(one): one.time_ns
        for one in recording.declared("paused")
        if pause.began_ns <= one.time_ns <= pause.ended_ns and one.process in publishing
    }
    # A helper that only publishes has no executor, so nothing of it can pause.
    spun = {_process_of(one) for one in recording.declared("spin")}
    must_pause = spun & set(publishing.values())
    if not began_ns or not must_pause <= began_ns.keys():
        return None
    all_began_ns = max(began_ns.values())
    judged_ns = all_began_ns + _GRACE * (pause.ended_ns - all_began_ns)
    uncalled_ns = (time_ns for time_ns in pause.received.get(topic, ()) if time_ns > judged_ns)
    return Paused(all_began_ns, pause.ended_ns, tuple(uncalled_ns))


def publishers(recording: Recording, topic: str) -> list[Declaration]:
    """Publishers on a topic of the processes that ran when the pause began.

    Those that were destroyed before are left out where others are left.
    """
    began_ns = recording.pauses[-1].began_ns
    ended = {_process_of(one) for one in recording.declared("exiting") if one.time_ns < began_ns}
    running = {
        process.name
        for process in recording.processes
        if process.exited_ns is None or process.exited_ns >= began_ns
    }
    found = [
        one
        for one in recording.declared("publisher")
        if one.data.get("topic") == topic
        and one.process in running
        and _process_of(one) not in ended
    ]
    kept = [one for one in found if destroyed(recording, one) is None]
    return kept or found


def _process_of(declared: Declaration) -> tuple[str, str]:
    """Which process declared something: its name, and the pid of this start of it."""
    return declared.process, str(declared.data.get("pid"))
