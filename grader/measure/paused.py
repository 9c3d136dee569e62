"""What was published while the executors paused after a run: no callback published it."""

from __future__ import annotations

from dataclasses import dataclass

from grader.measure.declarations import destroyed
from grader.recording.model import NS, Declaration, Recording

# A callback that runs when the pause begins may still publish: in the first interval of 2.5.
_GRACE = 0.4


@dataclass(frozen=True)
class Paused:
    """The pause of the processes that publish on a topic, and what came on the topic meanwhile."""

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
    # Of a process that was started again, the newest counts.
    publish = {one.process: _who(one) for one in publishers(recording, topic)}
    began = {
        _who(one): one.time_ns
        for one in recording.declared("paused")
        if pause.began_ns <= one.time_ns <= pause.ended_ns and one.process in publish
    }
    # A helper that only publishes has no executor.
    spun = {_who(one) for one in recording.declared("spin")}
    if not began or not spun & set(publish.values()) <= began.keys():
        return None
    began_ns = max(began.values())
    from_ns = began_ns + _GRACE * (pause.ended_ns - began_ns)
    times = pause.received.get(topic, ())
    return Paused(began_ns, pause.ended_ns, tuple(one for one in times if one > from_ns))


def publishers(recording: Recording, topic: str) -> list[Declaration]:
    """Publishers on a topic of the processes that ran when the pause began.

    Those that were destroyed before are left out where others are left.
    """
    began_ns = recording.pauses[-1].began_ns
    left = {_who(one) for one in recording.declared("exiting") if one.time_ns < began_ns}
    ran = {
        one.name
        for one in recording.processes
        if one.exited_ns is None or one.exited_ns >= began_ns
    }
    found = [
        one
        for one in recording.declared("publisher")
        if one.data.get("topic") == topic and one.process in ran and _who(one) not in left
    ]
    kept = [one for one in found if destroyed(recording, one) is None]
    return kept or found


def _who(declared: Declaration) -> tuple[str, str]:
    return declared.process, str(declared.data.get("pid"))
