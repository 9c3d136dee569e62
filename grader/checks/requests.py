"""Services and actions that are asked: whether they are there, and what the probe asked."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar, TypeVar

from pydantic import Field

from grader.checks.check import stop_if
from grader.checks.need import Doubt
from grader.checks.wrong_name import Named, misnamed
from grader.diagnosis.destroyed_endpoint import why_withdrawn
from grader.diagnosis.explanation import mistaken
from grader.diagnosis.no_endpoint import (
    ACTION,
    SERVICE,
    EntityKind,
    meant_endpoint,
    offered,
    why_not_met,
    why_not_offered,
)
from grader.diagnosis.process.process_exit import why_ended
from grader.findings.expected import Difference
from grader.findings.fields import difference_table, difference_words, fields_hint, unlike, words
from grader.findings.finding import Evidence, Finding, Moment, Table
from grader.findings.value import EXACT
from grader.findings.words import code
from grader.recording.interaction import NO_SERVER, Goal
from grader.recording.model import Call, Recording
from grader.spec.name import InterfaceName

_MOST_ROWS, _MOST_MOMENTS = 50, 8

Request = TypeVar("Request", Call, Goal)


class Offered(Named):
    """Part of the parameters of the checks that a service or an action is offered."""

    doubt = Doubt.ANSWER_MISSED
    kind: ClassVar[EntityKind]

    type: InterfaceName | None = Field(
        None, description="Its interface, as `ros2 interface list` shows it; by default any."
    )

    def _asked(self) -> str:
        article = "an" if self.kind is ACTION else "a"
        type_ = f" of {code(self.type)}" if self.type else ""
        return f"{article} {self.kind.noun} {code(self.asked_name[1])}{type_}"


def is_offered(recording: Recording, parameters: Offered) -> Finding:
    """The finding of a check that a node of the student offers a service or action."""
    kind, (_, name) = parameters.kind, parameters.asked_name
    cause = why_not_offered(recording, kind, name, parameters.type)
    servers = offered(recording, kind, name)
    times_s = [recording.since_launch_s(one.appeared_ns) for one in servers[:1]]
    shown = Evidence(moments=tuple(Moment(f"{kind.noun} {name} appeared", s) for s in times_s))
    meant = meant_endpoint(recording, kind, name, parameters.type)
    stop_if(misnamed(recording, parameters, cause, meant, shown))
    stop_if(why_withdrawn(recording, f"the {kind.noun} {code(name)}", servers))
    found = servers[0]
    return Finding.as_asked(
        f"{code(found.node)} offers it, with the type {code(found.type)}, seen {times_s[0]:.2f} s "
        "after launch",
        shown,
    )


def judged_requests(
    recording: Recording,
    kind: EntityKind,
    name: str,
    sent: Sequence[Request],
    fields: Mapping[str, Any],
    is_judged: Callable[[Request], bool] = lambda _: True,
) -> tuple[Request, ...]:
    """The requests to a service, or goals of an action, that have certain fields; one at least.

    Raises:
        Unmet: There is none, or one could not be sent.
        NoSuchField: A request cannot have such a field.
    """
    own = [one for one in sent if _asked_name(one) == name]
    stop_if(why_not_offered(recording, kind, name, own[0].type if own else None))
    failed = next((one.error for one in own if one.error not in ("", NO_SERVER)), None)
    if failed:
        stop_if(Finding.ours(f"{code(name)} could not be asked: {failed}"))
    judged = [one for one in own if not unlike(_content(one), fields, EXACT) and is_judged(one)]
    if not judged:
        request = "call" if kind is SERVICE else "goal"
        which = f" with {words(fields)}" if fields else ""
        never = f"the probe sent no such {request}{which} to {code(name)}"
        stop_if(why_ended(recording) or Finding.undecided(never))
    for one in judged:
        if one.error:
            stop_if(why_not_met(recording, kind, name, _sent_ns(one)))
    return tuple(judged)


def _asked_name(request: Call | Goal) -> str:
    return request.action if isinstance(request, Goal) else request.service


def _content(request: Call | Goal) -> Mapping[str, Any]:
    return request.goal if isinstance(request, Goal) else request.request or {}


def _sent_ns(request: Call | Goal) -> int:
    return request.sent_ns if isinstance(request, Goal) else request.requested_ns


def why_other_fields(
    seen: str,
    part: str,
    value: Mapping[str, Any] | None,
    found: Sequence[Difference],
    evidence: Evidence,
    hint: str = "",
) -> Finding | None:
    """Which fields of an answer are not as expected, or None if all are.

    Args:
        part: What the answer is called, such as ``result``.
        found: What is different in it.
    """
    if not found:
        return None
    tables = (difference_table(part.capitalize(), found), *evidence.tables)
    return mistaken(
        "other_answer",
        f"{seen} {difference_words(found)}",
        replace(evidence, tables=tables),
        look=hint or fields_hint(part, value or {}, [item.field for item in found]),
    )


def timeline(recording: Recording, title: str, steps: Iterable[tuple[int, str]]) -> Evidence:
    """What happened when, as a table and as moments; what follows a colon is for the table only."""
    in_order = [
        (recording.since_launch_s(time_ns), text)
        for time_ns, text in sorted(steps, key=lambda step: step[0])
    ]
    rows = tuple((f"{time_s:.2f} s", text) for time_s, text in in_order)
    moments = [
        Moment(text.partition(":")[0], time_s)
        for time_s, text in in_order
        if not text.startswith("feedback")
    ]
    table = Table(title, ("since launch", "what happened"), rows[:_MOST_ROWS])
    return Evidence(moments=tuple(moments[:_MOST_MOMENTS]), tables=(table,))
