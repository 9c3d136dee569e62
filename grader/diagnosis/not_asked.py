"""Why a client of the student asked less of a server than it should: one cause, the deepest."""

from __future__ import annotations

from dataclasses import dataclass, replace

from grader.diagnosis.explanation import cause_of, explanation, mistaken, remedy
from grader.diagnosis.no_answer import why_taken
from grader.diagnosis.no_endpoint import ACTION_CLIENT, CLIENT, why_not_offered
from grader.diagnosis.process.not_called import (
    NotCalled,
    blocked_executor,
    callback_raised,
    never_spun,
)
from grader.diagnosis.process.process_exit import process_ended
from grader.findings.fields import brief, words
from grader.findings.finding import Evidence, Finding, Moment, Table, until_the_end
from grader.findings.words import code
from grader.recording.interaction import Asked
from grader.recording.model import Recording

_AFTER = {
    "unanswered": "never_gives_up",
    "rejected": "ignores_rejection",
    "aborted": "ignores_status",
    "canceled": "ignores_status",
}
"""The mistake where nothing follows something that ended so."""
# What a report shows of them.
_MOST_ROWS, _MOST_MOMENTS = 50, 8


@dataclass(frozen=True)
class NotAsked(NotCalled):
    """Fewer requests or goals came to a server of the scenario than expected."""

    server: str
    needed: int
    only_failures = True

    @property
    def asked(self) -> tuple[Asked, ...]:
        """What came."""
        return self.recording.asked_of(self.server)

    @property
    def is_action(self) -> bool:
        """Whether the server is an action, by its topics."""
        return any(end.topic == f"{self.server}/_action/status" for end in self.recording.endpoints)

    @property
    def seen(self) -> str:
        """The symptom in words."""
        number = f"only {len(self.asked)} of {self.needed}" if self.asked else "none"
        noun = "goals" if self.is_action else "requests"
        return f"of the {noun} to {code(self.server)} {number} came"

    @property
    def nodes(self) -> set[str]:
        """The nodes that have a client of it."""
        clients = self.recording.clients
        names = (self.server, f"{self.server}/_action/send_goal")
        return {one.node for one in clients if one.name in names}

    @property
    def since_ns(self) -> int:
        """When the last one came, or the launch."""
        return self.asked[-1].asked_ns if self.asked else self.recording.launched_ns

    @property
    def excuse(self) -> Finding | None:
        """The machine's doing, if it took all of the time since then."""
        end_ns = self.recording.stop_ns
        return why_taken(self.recording, self.seen, self.since_ns, end_ns, 0.0)


def why_not_asked(recording: Recording, server: str, needed: int) -> Finding:
    """Why fewer requests or goals came than needed."""
    return cause_of(NotAsked(recording, server, needed))


@explanation(NotAsked, before=(process_ended,))
def no_client(symptom: NotAsked) -> Finding | None:
    """There is no client: it is missing, or its name is misspelt."""
    if symptom.asked or symptom.nodes:
        return None
    word = ACTION_CLIENT if symptom.is_action else CLIENT
    return why_not_offered(symptom.recording, word, symptom.server)


@explanation(NotAsked, after=(callback_raised,), before=(never_spun,), concept="executors")
def waits_in_a_callback(symptom: NotAsked) -> Finding | None:
    """call() or spin_until_future_complete() in a callback waits for an answer, and blocks it."""
    blocked = blocked_executor(symptom) if symptom.asked else None
    return replace(blocked, hint=remedy("waits_in_a_callback")) if blocked is not None else None


@explanation(NotAsked, after=(blocked_executor,))
def stops_after_a_failure(symptom: NotAsked) -> Finding | None:
    """Nothing follows a goal that was rejected or aborted, or a request without an answer."""
    status = symptom.asked[-1].status if symptom.asked else ""
    if status not in _AFTER:
        return None
    seen = f"{symptom.seen}; nothing follows the last one, {status}"
    return mistaken(_AFTER[status], seen, evidence(symptom.recording, symptom.asked))


@explanation(NotAsked, general=True)
def too_few(symptom: NotAsked) -> Finding:
    """The request was sent before the server was found, or never."""
    recording, seen = symptom.recording, symptom.seen
    if symptom.asked:
        return mistaken("too_few_asked", seen, evidence(recording, symptom.asked))
    moment = until_the_end(recording, "still nothing was asked")
    return mistaken(
        "never_sent", f"{seen}, although the client was there", Evidence(moments=(moment,))
    )


def evidence(recording: Recording, asked: tuple[Asked, ...]) -> Evidence:
    """What was asked, and what became of it."""
    header = ("asked at", "fields", "status", "answer", "ended at")
    moments, rows = [], []
    for item in asked[:_MOST_ROWS]:
        asked_s, fields = recording.since_launch_s(item.asked_ns), brief(item.fields)
        moments.append(Moment(f"asked: {fields}", asked_s))
        answer = end = ""
        if item.answer is not None:
            answer = words(item.answer)
        if item.ended_ns is not None:
            end = f"{recording.since_launch_s(item.ended_ns):.2f} s"
        rows.append((f"{asked_s:.2f} s", fields, item.status or "open", answer, end))
    table = Table("What was asked", header, tuple(rows))
    return Evidence(moments=tuple(moments[:_MOST_MOMENTS]), tables=(table,) if rows else ())
