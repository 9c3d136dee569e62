"""What was published while the executors paused after a run: no callback published it."""

from __future__ import annotations

from dataclasses import dataclass

from grader.measure.declarations import destroyed
from grader.recording.model import NS, Declaration, Recording

# A pause lasts 2.5 intervals between two messages. A callback that runs as it begins may still
# publish for one of them, which is 1 / 2.5 of the pause.
_UNJUDGED_SHARE = 0.4


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
        """Whether a message of what publishes in the rhythm of the run falls into the pause."""
        times_ns = [message.received_ns for message in recording.on(topic)]
        intervals = max(len(times_ns) - 1, 1)
        mean_interval_ns = (max(times_ns) - min(times_ns)) / intervals
        return mean_interval_ns <= (1.0 - _UNJUDGED_SHARE) * (self.ended_ns - self.began_ns)

    def is_doubtful(self, recording: Recording) -> bool:
        """Whether the machine may have held up a message of the run until it was judged."""
        unjudged_s = _UNJUDGED_SHARE * (self.ended_ns - self.began_ns) / NS
        return recording.stolen_s(self.began_ns, self.ended_ns) > unjudged_s


def paused(recording: Recording, topic: str) -> Paused | None:
    """How the processes with a publisher on a topic paused, or None where one did not."""
    pause = recording.pauses[-1]
    # A process that was started again has the same name: its newest start counts.
    newest_start = {made.process: _start_of(made) for made in publishers(recording, topic)}
    began_ns = {
        _start_of(declared): declared.time_ns
        for declared in recording.declared("paused")
        if pause.began_ns <= declared.time_ns <= pause.ended_ns and declared.process in newest_start
    }
    # A helper that only publishes has no executor, so nothing of it can pause.
    with_executor = {_start_of(declared) for declared in recording.declared("spin")}
    must_pause = with_executor.intersection(newest_start.values())
    if not began_ns or not must_pause.issubset(began_ns):
        return None
    all_began_ns = max(began_ns.values())
    judged_from_ns = all_began_ns + _UNJUDGED_SHARE * (pause.ended_ns - all_began_ns)
    received_ns = pause.received.get(topic, ())
    uncalled_ns = tuple(time_ns for time_ns in received_ns if time_ns > judged_from_ns)
    return Paused(all_began_ns, pause.ended_ns, uncalled_ns)


def publishers(recording: Recording, topic: str) -> list[Declaration]:
    """Publishers on a topic of the processes that ran when the pause began.

    One that the program destroyed counts only if it destroyed all of them.
    """
    began_ns = recording.pauses[-1].began_ns
    running = {
        process.name
        for process in recording.processes
        if process.exited_ns is None or process.exited_ns >= began_ns
    }
    exiting = recording.declared("exiting")
    ended = {_start_of(declared) for declared in exiting if declared.time_ns < began_ns}
    made = [
        declared
        for declared in recording.declared("publisher")
        if declared.data.get("topic") == topic
        and declared.process in running
        and _start_of(declared) not in ended
    ]
    return [one for one in made if destroyed(recording, one) is None] or made


def _start_of(declared: Declaration) -> tuple[str, str]:
    """Which start of a process declared something: the name of the process, and its pid."""
    return declared.process, str(declared.data.get("pid"))
