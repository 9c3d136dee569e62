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
from grader.measure.compatibility import comparisons, compatibility_table, refusals
from grader.recording.model import Endpoint, Kind, Qos, Recording
from grader.spec.name import Durability, Id, Reliability, TopicName
from grader.spec.quantity import Duration

_DEFAULT = Qos(reliability="reliable", durability="volatile", liveliness="automatic")


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
            reliability=self.reliability or _DEFAULT.reliability,
            durability=self.durability or _DEFAULT.durability,
            deadline_s=self.deadline,
            liveliness=self.liveliness or _DEFAULT.liveliness,
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
    who = f"a {'subscription' if kind is Kind.PUBLISHER else 'publisher'}"
    peer = parameters.peer(recording)
    wish = "matches" if parameters.expect == "match" else "does not match"
    profile = f" ({_words(peer)})" if peer else ""
    expected = f"{who}{profile} {wish} the {kind.value} on {code(parameters.topic)}"
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
        offered, requested = _sides(kind, endpoint, peer)
        refused = refusals(offered, requested)
        evidence = Evidence(
            moments=endpoints_seen(recording, (endpoint,)),
            tables=(compatibility_table(offered, requested),),
        )
        if refused and parameters.expect == "refuse":
            open_ = _left_open(recording, kind, endpoint, peer)
            if open_:
                return Finding.failed(
                    expected, _open_words(endpoint, open_), _profile_hint(kind), evidence
                )
        if bool(refused) is (parameters.expect == "refuse"):
            continue
        if refused:
            return Finding.failed(
                expected,
                f"the {kind.value} of {code(endpoint.node)} and this peer do not match: "
                + ", ".join(refused),
                "A subscription receives nothing from a publisher that offers less than it "
                f"requests. {_profile_hint(kind)}",
                evidence,
            )
        return Finding.failed(
            expected,
            f"the {kind.value} of {code(endpoint.node)} and this peer match: no policy of what is "
            "offered is weaker than what is requested",
            _profile_hint(kind),
            evidence,
        )
    offered, requested = _sides(kind, endpoints[0], peer)
    evidence = Evidence(tables=(compatibility_table(offered, requested),))
    contradiction = _contradiction(recording, parameters)
    destroyed = why_unpublished(recording, parameters.topic, "they did not meet")
    if contradiction and destroyed is not None and parameters.expect == "match":
        return destroyed.finding(expected)
    if contradiction:
        return Finding.to_repeat(expected, contradiction)
    reasons = refusals(offered, requested)
    return Finding.passed(expected, ", ".join(reasons) or "no policy stands against it", evidence)


def _sides(kind: Kind, endpoint: Endpoint, peer: Qos) -> tuple[Qos, Qos]:
    """What is offered, what is requested."""
    return (endpoint.qos, peer) if kind is Kind.PUBLISHER else (peer, endpoint.qos)


def _left_open(recording: Recording, kind: Kind, endpoint: Endpoint, peer: Qos) -> tuple[str, ...]:
    """Policies by which a subscription refuses the peer only because of others that were there.

    None where another policy refuses it all the same. What a publisher offers as the best
    available is always the strongest.
    """
    if kind is not Kind.SUBSCRIPTION:
        return ()
    open_ = declarations.left_open(recording, kind, endpoint.topic, endpoint.node)
    offered, requested = _sides(kind, endpoint, peer)
    deciding = [item.policy for item in comparisons(offered, requested) if item.compatible is False]
    return tuple(deciding) if open_.issuperset(deciding) else ()


def _open_words(endpoint: Endpoint, policies: tuple[str, ...]) -> str:
    names = " and ".join(policies)
    taken = ", ".join(str(getattr(endpoint.qos, policy)) for policy in policies)
    return (
        f"the subscription of {code(endpoint.node)} asks for the best available {names}, declared "
        "by the process: it requests what the publishers offer that are there when it is made, "
        f"here {taken}; to this peer alone it would give way"
    )


def _contradiction(recording: Recording, parameters: Compatible) -> str:
    """What happened to the late joiner is not what the rules say: discovery failed."""
    for join in recording.joins:
        if join.name == parameters.joiner:
            matched = join.matched_ns is not None
            if matched is not (parameters.expect == "match"):
                did = "matched" if matched else "was never matched"
                return f"by the rules of DDS it is so, but {code(join.name)} {did}"
    return ""


def _words(qos: Qos) -> str:
    words = [qos.reliability, qos.durability]
    words += [qos.liveliness] if qos.liveliness == "manual_by_topic" else []
    if qos.deadline_s is not None:
        words.append(f"deadline {qos.deadline_s:g} s")
    if qos.liveliness_lease_s is not None:
        words.append(f"liveliness lease {qos.liveliness_lease_s:g} s")
    return ", ".join(words)


def _profile_hint(kind: Kind) -> str:
    create = "create_publisher" if kind is Kind.PUBLISHER else "create_subscription"
    return (
        f"Give {create} a QoSProfile with the policies that are asked for; a number, such as 10, "
        "is the default: reliable and volatile."
    )
