"""Whether an endpoint of the student's and a certain peer match, by the rules of DDS."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from grader.checks.check import Parameters, Subject, check
from grader.checks.finding import Evidence, Finding
from grader.checks.first_seen import endpoints_seen
from grader.checks.need import Joined
from grader.checks.wording import code
from grader.diagnosis.destroyed_endpoint import why_unpublished
from grader.diagnosis.no_endpoint import why_no_endpoint
from grader.measure import declarations
from grader.measure.compatibility import comparisons, compatibility_table, refusals, sides
from grader.recording.model import Endpoint, Kind, Qos, Recording
from grader.spec.name import Durability, Id, Reliability, TopicName
from grader.spec.quantity import Duration

_RULE = "A subscription receives nothing from a publisher that offers less than it requests."
_HINT = (
    "Give create_{} a QoSProfile with the policies that are asked for; a number, such as 10, is "
    "the default: reliable and volatile."
)


class Compatible(Parameters):
    """Parameters of qos.compatible."""

    needs = (Joined(),)

    topic: TopicName = Field(description="Fully qualified topic name.")
    kind: Literal["publisher", "subscription"] = Field(
        description="Which end is the student's; the peer is the other end."
    )
    joiner: Id | None = Field(
        None,
        description="The peer is this late joiner (the `name` of a `join`), with the QoS that it "
        "requests: judged by what happened, too.",
    )
    reliability: Reliability | None = Field(
        None, description="Reliability of the peer, by default reliable."
    )
    durability: Durability | None = Field(
        None, description="Durability of the peer, by default volatile."
    )
    deadline: Duration | None = Field(None, description="Deadline of the peer.")
    liveliness: Literal["automatic", "manual_by_topic"] | None = Field(
        None, description="Liveliness of the peer, by default automatic."
    )
    lease: Duration | None = Field(None, description="Lease duration of the peer's liveliness.")
    expect: Literal["match", "refuse"] = Field(
        "match", description="Whether the two must match, or must not."
    )

    @model_validator(mode="after")
    def _one_peer(self) -> Compatible:
        own = ("reliability", "durability", "deadline", "liveliness", "lease")
        given = [name for name in own if getattr(self, name) is not None]
        if self.joiner is not None and given:
            raise ValueError(f"the late joiner's QoS is in its stimulus: leave {given[0]!r} out")
        if self.joiner is not None and self.kind == "subscription":
            raise ValueError("a late joiner subscribes: the student's end is the publisher")
        return self

    def peer(self, recording: Recording) -> Qos | None:
        """The peer's profile; None if the late joiner never joined."""
        if self.joiner is not None:
            joins = [item for item in recording.joins if item.name == self.joiner]
            return joins[0].qos if joins else None
        return Qos(
            reliability=self.reliability or "reliable",
            durability=self.durability or "volatile",
            deadline_s=self.deadline,
            liveliness=self.liveliness or "automatic",
            liveliness_lease_s=self.lease,
        )


@check("qos.compatible", Subject.RECORDING, Compatible)
def compatible(recording: Recording, parameters: Compatible) -> Finding:
    """A certain peer would match, or would not, as the DDS rules say.

    Judged by what DDS discovered of every endpoint of the student's on the topic, by the rule
    "requested against offered": reliability, durability, deadline, liveliness and its lease
    duration. With a late joiner as the peer, it is judged by whether the two did match. A
    subscription with the policy "best available" matches every publisher: it requests what the
    publishers offer that are there when it is created. Only the process can declare that.
    """
    kind = Kind(parameters.kind)
    other = "subscription" if kind is Kind.PUBLISHER else "publisher"
    peer = parameters.peer(recording)
    verb = "matches" if parameters.expect == "match" else "does not match"
    profile = f" ({_words(peer)})" if peer else ""
    expected = f"a {other}{profile} {verb} the {kind.value} on {code(parameters.topic)}"
    cause = why_no_endpoint(recording, kind, parameters.topic)
    if cause is not None:
        return cause.finding(expected)
    endpoints = recording.student_endpoints(kind, parameters.topic)
    if peer is None:
        return Finding.error(
            expected, f"the run ended before {code(parameters.joiner or '')} joined"
        )
    if not endpoints:
        return Finding.error(expected, f"the {kind.value} was not discovered")
    for endpoint in endpoints:
        pair = sides(kind, endpoint.qos, peer)
        refused = refusals(*pair)
        own = f"the {kind.value} of {code(endpoint.node)}"
        left_open = _left_open(recording, endpoint, pair)
        hint = _HINT.format(kind.value)
        if refused and parameters.expect == "match":
            observed = f"{own} and this peer do not match: {', '.join(refused)}"
            hint = f"{_RULE} {hint}"
        elif refused and left_open:
            taken = ", ".join(str(getattr(endpoint.qos, policy)) for policy in left_open)
            observed = (
                f"{own} asks for the best available {' and '.join(left_open)}, declared by the "
                "process: it requests what the publishers offer that are there when it is created, "
                f"here {taken}, and would match this peer alone"
            )
        elif not refused and parameters.expect == "refuse":
            observed = (
                f"{own} and this peer match: no policy of what is offered is weaker than what is "
                "requested"
            )
        else:
            continue
        evidence = Evidence(
            moments=endpoints_seen(recording, (endpoint,)), tables=(compatibility_table(*pair),)
        )
        return Finding.failed(expected, observed, hint, evidence)
    join = next((item for item in recording.joins if item.name == parameters.joiner), None)
    matched = join is not None and join.matched_ns is not None
    if join is not None and matched is not (parameters.expect == "match"):
        # What happened to the late joiner is not what the rules say.
        destroyed = why_unpublished(recording, parameters.topic, "they did not match")
        if destroyed is not None and not matched:
            return destroyed.finding(expected)
        did = "matched" if matched else "was never matched"
        return Finding.to_repeat(
            expected, f"by the rules of DDS it is so, but {code(join.name)} {did}"
        )
    pair = sides(kind, endpoints[0].qos, peer)
    return Finding.passed(
        expected,
        ", ".join(refusals(*pair)) or "no policy stands against it",
        Evidence(tables=(compatibility_table(*pair),)),
    )


def _left_open(recording: Recording, endpoint: Endpoint, pair: tuple[Qos, Qos]) -> tuple[str, ...]:
    """Policies by which a subscription refuses the peer only because of others that were there.

    None where another policy refuses it all the same. What a publisher offers as the best
    available is always the strongest.
    """
    if endpoint.kind is Kind.PUBLISHER:
        return ()
    open_ = declarations.left_open(recording, endpoint.kind, endpoint.topic, endpoint.node)
    deciding = [item.policy for item in comparisons(*pair) if item.compatible is False]
    return tuple(deciding) if open_.issuperset(deciding) else ()


def _words(qos: Qos) -> str:
    words = [qos.reliability, qos.durability]
    words += [qos.liveliness] if qos.liveliness == "manual_by_topic" else []
    durations = {"deadline": qos.deadline_s, "liveliness lease": qos.liveliness_lease_s}
    words += [f"{name} {item:g} s" for name, item in durations.items() if item is not None]
    return ", ".join(words)
