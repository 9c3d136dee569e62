"""Why something that was asked of a node was not answered in time: one cause, the deepest."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from grader.diagnosis.explanation import cause_of, explanation, mistaken
from grader.diagnosis.no_endpoint import EntityKind, offered
from grader.diagnosis.process.not_called import (
    NotCalled,
    at_its_place,
    blocked_executor,
    never_spun,
)
from grader.diagnosis.process.process_exit import exited
from grader.diagnosis.process.standing import where_it_stands
from grader.findings.finding import Evidence, Finding, evidence_at
from grader.measure import declarations
from grader.recording.interaction import executor_services
from grader.recording.model import NS, Process, Recording
from grader.spec.unit import format_duration

_ROUNDING_S = 1e-6


@dataclass(frozen=True)
class NoAnswer(NotCalled, concept="executors"):
    """A call or a goal was not answered in time.

    Attributes:
        what: The symptom in words, such as ``the call was not answered``.
        name: Of the service or action.
        while_busy: The cause where the executor is blocked or nothing tells, if not general.
    """

    what: str
    server: EntityKind
    name: str
    asked_ns: int
    within_s: float
    while_busy: Finding | None = None

    @property
    def node(self) -> str:
        """The node that offers it; a parameter service is named after its node."""
        own = offered(self.recording, self.server, self.name)
        return own[-1].node if own else self.name.rpartition("/")[0]

    @property
    def seen(self) -> str:
        """The symptom in words."""
        return self.what

    @property
    def unanswered(self) -> str:
        """The service or action."""
        return self.name

    @property
    def nodes(self) -> Collection[str]:
        """The node that should answer."""
        return (self.node,)

    @property
    def processes(self) -> Sequence[Process]:
        """The process of the node, if it is known."""
        process = declarations.process_of(self.recording, self.node)
        return () if process is None else (process,)

    @property
    def ended(self) -> Sequence[Process]:
        """The process of the node, if it did; any where that is not known."""
        ended = exited(self.recording)
        return [one for one in ended if one in self.processes] if self.processes else ended

    @property
    def since_ns(self) -> int:
        """When it was asked."""
        return self.asked_ns

    @property
    def excuse(self) -> Finding | None:
        """The machine's doing, if it took as much as the answer was too late."""
        end_ns = self.recording.stop_ns
        return why_taken(self.recording, self.what, self.asked_ns, end_ns, self.within_s)

    @property
    def spins(self) -> bool | None:
        """Whether the executor answered a call of its own since then; None if it got none."""
        services, latest_ns = executor_services(self.node), self.recording.stop_ns - NS
        calls = [
            call
            for call in self.recording.calls
            if call.service in services and self.asked_ns <= call.requested_ns <= latest_ns
        ]
        if not calls:
            return None
        return any((call.answered_ns or 0) > self.asked_ns for call in calls)

    def placed(self, cause: Finding) -> Finding:
        """A cause with the time of the call, and with where the process did not go on."""
        evidence = evidence_at(self.recording, "call, not answered in time", self.asked_ns)
        timed = replace(cause, evidence=evidence)
        process = declarations.process_of(self.recording, self.node)
        stand = where_it_stands(self.recording, process.name) if process is not None else None
        return at_its_place(timed, self.what, stand)


def why_late(
    symptom: NoAnswer, answered_ns: int | None, mistake: str, evidence: Evidence
) -> Finding | None:
    """Why an answer did not come in time, or None if it did.

    Args:
        mistake: Where the node is there and the machine took no time.
    """
    recording, asked_ns = symptom.recording, symptom.asked_ns
    if answered_ns is None:
        return cause_of(symptom)
    took_s = (answered_ns - asked_ns) / NS
    if took_s <= symptom.within_s:
        return None
    seen = f"{symptom.what} for {format_duration(took_s)}"
    taken = why_taken(recording, seen, asked_ns, answered_ns, symptom.within_s)
    return taken or mistaken(mistake, seen, evidence)


@explanation(NoAnswer, after=(never_spun,), before=(blocked_executor,))
def busy_with_something_else(symptom: NoAnswer) -> Finding | None:
    """The executor is busy with what was asked before, such as a goal."""
    if symptom.spins or symptom.while_busy is None:
        return None
    return symptom.placed(symptom.while_busy)


@explanation(NoAnswer, general=True)
def callback_does_not_answer(symptom: NoAnswer) -> Finding:
    """The callback does not finish, or waits for another callback of its group."""
    spins = ", although the node's executor spins" if symptom.spins else ""
    return symptom.placed(mistaken("callback_does_not_answer", f"{symptom.what}{spins}"))


def why_taken(
    recording: Recording, what: str, begin_ns: int, end_ns: int, within_s: float
) -> Finding | None:
    """The machine's doing, if it took as much as something was too late; else None.

    An answer that never came was not due where the observation ended before its time.
    """
    stolen_s = recording.stolen_s(begin_ns, end_ns)
    excess_s = (end_ns - begin_ns) / NS - within_s
    if excess_s < -_ROUNDING_S:
        ended = format_duration((end_ns - begin_ns) / NS)
        return Finding.undecided(f"{what}: the run ended {ended} later, before the answer was due")
    if stolen_s <= 0.0 or stolen_s < excess_s:
        return None
    return Finding.held_up(what, stolen_s)
