"""Checks of quality of service: what publishers offer, what subscriptions request, what matches."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any, ClassVar, Literal

from pydantic import Field, model_validator

from grader.checks.check import Parameters, Subject, check, stop_if
from grader.diagnosis.explanation import mistaken, remedy
from grader.diagnosis.no_endpoint import why_no_endpoint
from grader.diagnosis.undeclared import why_undeclared
from grader.findings.finding import Evidence, Finding, endpoints_seen, first_seen
from grader.findings.words import Words, code, counted
from grader.measure import declarations
from grader.measure.compatibility import (
    comparisons,
    compatibility_table,
    duration_words,
    refusals,
    sides,
)
from grader.recording.model import NS, Endpoint, Kind, Qos, Recording
from grader.spec.name import Durability, Reliability, TopicName
from grader.spec.quantity import Duration

# Messages that tell whether a queue was always full.
_FEWEST = 5
# DDS carries durations as seconds and a fraction of 2**32.
_SAME_DURATION = 1e-3
_DEFAULTS = {"reliability": "reliable", "durability": "volatile", "liveliness": "automatic"}
_POLICIES = (*_DEFAULTS, "deadline", "lifespan", "lease")
# Where the attribute of our profile, or the argument of rclpy's, has another name than the YAML.
_ATTRIBUTES = {"deadline": "deadline_s", "lifespan": "lifespan_s", "lease": "liveliness_lease_s"}
_ARGUMENTS = {"lease": "liveliness_lease_duration"}
_DECLARED_POLICIES = {"reliability", "durability"}
"""What a process declares of an endpoint."""
_WORDS = {
    Kind.PUBLISHER: ("offers", "offered", "subscription that requests"),
    Kind.SUBSCRIPTION: ("requests", "requested", "publisher that offers"),
}


class Profile(Parameters):
    """Part of the parameters of qos.offered and qos.requested."""

    kind: ClassVar[Kind]

    topic: TopicName = Field(description="Fully qualified topic name.")
    reliability: Reliability | None = Field(None, description="Expected reliability.")
    durability: Durability | None = Field(None, description="Expected durability.")
    deadline: Duration | None = Field(None, description="Expected deadline.")
    lifespan: Duration | None = Field(None, description="Expected lifespan.")
    liveliness: Literal["automatic", "manual_by_topic"] | None = Field(
        None, description="Expected liveliness."
    )
    lease: Duration | None = Field(None, description="Expected lease duration of the liveliness.")

    @model_validator(mode="after")
    def _something(self) -> Profile:
        if not self.policies:
            raise ValueError(f"name a policy: {', '.join(_POLICIES)}")
        return self

    def _asked(self) -> str:
        wanted = ", ".join(f"{name} {_words(item)}" for name, item in self.policies.items())
        return f"the {self.kind.value} on {code(self.topic)} {_WORDS[self.kind][0]} {wanted}"

    @property
    def policies(self) -> dict[str, Any]:
        """Policy -> expected value, those that are asked for only."""
        return {name: getattr(self, name) for name in _POLICIES if getattr(self, name) is not None}

    @property
    def qos(self) -> Qos:
        """The expected profile, everything else unknown."""
        return Qos(**{_ATTRIBUTES.get(name, name): item for name, item in self.policies.items()})


class Offered(Profile):
    """Parameters of qos.offered."""

    of_bags = True
    kind = Kind.PUBLISHER


@check("qos.offered", Subject.RECORDING, Offered, concept="qos")
def offered(recording: Recording, parameters: Offered) -> Finding:
    """Publishers on the topic offer the expected QoS.

    Judged by what DDS discovered of every publisher of the student's on the topic; only the
    policies that are named in the parameters count. Queue depth is judged by qos.depth.
    """
    return _judge(recording, parameters)


class Requested(Profile):
    """Parameters of qos.requested."""

    kind = Kind.SUBSCRIPTION


@check("qos.requested", Subject.RECORDING, Requested, concept="qos")
def requested(recording: Recording, parameters: Requested) -> Finding:
    """Subscriptions to the topic request the expected QoS.

    Judged by what DDS discovered of every subscription of the student's to the topic; only the
    policies that are named in the parameters count.
    """
    return _judge(recording, parameters)


def _judge(recording: Recording, parameters: Profile) -> Finding:
    kind = parameters.kind
    has, did, other_end = _WORDS[kind]
    stop_if(why_no_endpoint(recording, kind, parameters.topic))
    endpoints = recording.student_endpoints(kind, parameters.topic)
    profiles = [(endpoint.node, endpoint.qos) for endpoint in endpoints]
    source = ""
    if not endpoints and set(parameters.policies) <= _DECLARED_POLICIES:
        # It published, and was destroyed before it could be discovered.
        profiles += declarations.profiles(recording, kind, parameters.topic)
        source = ", declared by the process"
    for node, qos in profiles:
        wrong = _wrong(qos, parameters)
        if wrong:
            seen = f"the {kind.value} of {code(node)} {has} {_differences(wrong)}{source}"
            seen += _consequence(qos, parameters, other_end)
            own = [endpoint for endpoint in endpoints if endpoint.qos is qos]
            moments = endpoints_seen(recording, own)
            shown = moments or first_seen(recording, recording.on(parameters.topic))
            return _mistaken(parameters, wrong, seen, Evidence(moments=shown))
    unknown = [
        name
        for name in parameters.policies
        if name in _DEFAULTS and any(getattr(qos, name) == "unknown" for _, qos in profiles)
    ]
    if unknown or not profiles:
        names = ", ".join(unknown) or "QoS"
        return Finding.ours(f"{names} of the {kind.value} was not discovered")
    return Finding.as_asked(f"{did} by {counted(len(profiles), kind.value)}{source}")


def _differences(wrong: Mapping[str, tuple[Any, Any]]) -> str:
    return ", ".join(
        f"{name} {_words(actual)} instead of {_words(wanted)}"
        for name, (wanted, actual) in wrong.items()
    )


def _consequence(qos: Qos, parameters: Profile, other_end: str) -> str:
    """Whether a profile still matches those that the expected one is made for."""
    peer = f"a {other_end} the expected profile"
    refused = refusals(*sides(parameters.kind, qos, parameters.qos))
    return f": {peer} does not match it" if refused else f"; {peer} would still match it"


def _wrong(qos: Qos, parameters: Profile) -> dict[str, tuple[Any, Any]]:
    """Policy -> (expected, found) where they differ and are known."""
    wrong: dict[str, tuple[Any, Any]] = {}
    for name, wanted in parameters.policies.items():
        actual = getattr(qos, _ATTRIBUTES.get(name, name))
        if name in _DEFAULTS:
            is_right = actual in (wanted, "unknown")
        else:
            is_right = actual is not None and math.isclose(actual, wanted, rel_tol=_SAME_DURATION)
        if not is_right:
            wrong[name] = wanted, actual
    return wrong


def _mistaken(parameters: Profile, wrong: Collection[str], seen: str, shown: Evidence) -> Finding:
    asked = parameters.policies
    if all(_DEFAULTS.get(name) == item for name, item in asked.items()):
        # Nothing has to be set: say what the student's profile is for instead.
        names = {"reliability": "best_effort_profile", "durability": "latched_profile"}
        why = "".join(f" {remedy(name)}" for policy, name in names.items() if policy in wrong)
        return mistaken("no_default", seen, shown, why=why)
    policies = "".join(str(_policy(name, item)) for name, item in asked.items())
    kind = parameters.kind.value
    return mistaken("other_profile", seen, shown, kind=kind, policies=policies)


def _policy(name: str, value: Any) -> Words:
    """A policy as an argument of rclpy's QoSProfile, and as a method of rclcpp::QoS."""
    key = _ARGUMENTS.get(name, name)
    if name not in _DEFAULTS:
        return Words(f", {key}=Duration(seconds={value:g})", f".{key}({value:g}s)")
    cpp = ".durability_volatile()" if value == "volatile" else f".{value}()"
    if name == "liveliness":
        camel = "".join(map(str.capitalize, value.split("_")))
        cpp = f".liveliness(rclcpp::LivelinessPolicy::{camel})"
    return Words(f", {key}={name.capitalize()}Policy.{value.upper()}", cpp)


def _words(value: Any) -> str:
    return value if isinstance(value, str) else duration_words(value)


class Depth(Parameters):
    """Parameters of qos.depth."""

    topic: TopicName = Field(description="Fully qualified topic name.")
    depth: int = Field(ge=1, description="Expected queue depth (history keep_last).")
    kind: Literal["publisher", "subscription"] = Field(
        "publisher", description="Which endpoint of the student to judge."
    )

    def _asked(self) -> str:
        return f"queue depth {self.depth} of the {self.kind} on {code(self.topic)}"


@check("qos.depth", Subject.RECORDING, Depth, concept="qos")
def depth(recording: Recording, parameters: Depth) -> Finding:
    """The queue has the expected depth.

    Discovery does not include history and depth. So this is judged by what the process declared
    when it created the endpoint. The heartbeats of a reliable publisher show how many messages it
    keeps: they count more.
    """
    kind = Kind(parameters.kind)
    stop_if(why_no_endpoint(recording, kind, parameters.topic))
    declared = declarations.queues(recording, kind, parameters.topic)
    kept = _kept(recording, parameters)
    observed = _wrong_depth(parameters, declared, kept)
    if observed:
        own = recording.student_endpoints(kind, parameters.topic)
        moments = endpoints_seen(recording, own)
        return mistaken(
            "other_depth",
            observed,
            Evidence(moments=moments or first_seen(recording, recording.on(parameters.topic))),
            argument="third" if kind is Kind.PUBLISHER else "fourth",
            kind=kind.value,
            depth=parameters.depth,
        )
    if any(queue.depth is None for queue in declared):
        return Finding.ours("the depth cannot be seen: the process declared no number")
    if not declared and kept is None:
        what = f"the {kind.value} on {code(parameters.topic)}"
        return why_undeclared(recording, what)
    source = "declared by the process" if declared else "as the heartbeats of the publisher show"
    return Finding.as_asked(f"depth {parameters.depth}, {source}")


def _wrong_depth(
    parameters: Depth, declared: tuple[declarations.DeclaredQueue, ...], kept: int | None
) -> str:
    """What shows another depth than the expected one, or nothing."""
    for queue in declared:
        if queue.history == "keep_all":
            return "history keep_all, declared by the process: the depth has no meaning then"
        if queue.depth not in (None, parameters.depth):
            return f"depth {queue.depth}, declared by the process"
    if kept is None or kept == parameters.depth:
        return ""
    shown = f"the heartbeats of the publisher show that it keeps {counted(kept, 'message')}"
    return f"depth {parameters.depth} is declared, but {shown}" if declared else shown


def _kept(recording: Recording, parameters: Depth) -> int | None:
    """How many messages the publishers keep, as their heartbeats show; None if they do not tell.

    A volatile publisher forgets what every subscription has acknowledged, for which it asks with
    a heartbeat: every few seconds, and where its queue is full. So it may keep fewer than its depth
    allows, unless it sends often and asks at every second message.
    """
    times_ns = [message.stamp_ns for message in recording.on(parameters.topic)]
    sends_often = len(times_ns) > _FEWEST and times_ns[-1] - times_ns[0] < len(times_ns) * NS
    own = recording.student_endpoints(Kind(parameters.kind), parameters.topic)
    for publisher in own:
        if publisher.kept is None:
            continue
        if publisher.kept > parameters.depth:
            return publisher.kept
        is_full = sends_often and publisher.heartbeats >= max(_FEWEST, len(times_ns) // 2)
        if is_full and 2 * publisher.kept < parameters.depth:
            return publisher.kept
    is_as_asked = {publisher.kept for publisher in own} == {parameters.depth}
    return parameters.depth if is_as_asked else None


class Compatible(Parameters):
    """Parameters of qos.compatible."""

    topic: TopicName = Field(description="Fully qualified topic name.")
    kind: Literal["publisher", "subscription"] = Field(
        description="Which endpoint is the student's. The peer is the other one."
    )
    reliability: Reliability = Field("reliable", description="Reliability of the peer.")
    durability: Durability = Field("volatile", description="Durability of the peer.")
    deadline: Duration | None = Field(None, description="Deadline of the peer.")
    liveliness: Literal["automatic", "manual_by_topic"] = Field(
        "automatic", description="Liveliness of the peer."
    )
    lease: Duration | None = Field(None, description="Lease duration of the peer's liveliness.")
    expect: Literal["match", "refuse"] = Field(
        "match", description="Whether the two must match, or must not."
    )

    def _asked(self) -> str:
        verb = "matches" if self.expect == "match" else "does not match"
        profile = _profile_words(self.peer)
        return f"a {self.other} ({profile}) {verb} the {self.kind} on {code(self.topic)}"

    @property
    def other(self) -> str:
        """Kind of the peer."""
        return "subscription" if self.kind == "publisher" else "publisher"

    @property
    def peer(self) -> Qos:
        """The peer's profile."""
        return Qos(
            reliability=self.reliability,
            durability=self.durability,
            deadline_s=self.deadline,
            liveliness=self.liveliness,
            liveliness_lease_s=self.lease,
        )


@check("qos.compatible", Subject.RECORDING, Compatible, concept="qos")
def compatible(recording: Recording, parameters: Compatible) -> Finding:
    """A given peer matches or does not match, by the rules of DDS.

    Judged by what DDS discovered of every endpoint of the student's on the topic, by the rule
    "requested against offered": reliability, durability, deadline, liveliness and its lease
    duration. A subscription with the policy "best available" matches every publisher: it requests
    what the publishers offer that are there when it is created. Only the process itself can declare
    that.
    """
    kind = Kind(parameters.kind)
    stop_if(why_no_endpoint(recording, kind, parameters.topic))
    endpoints = recording.student_endpoints(kind, parameters.topic)
    if not endpoints:
        return Finding.ours(f"the {kind.value} was not discovered")
    for endpoint in endpoints:
        stop_if(_why_otherwise(recording, parameters, endpoint))
    pair = sides(kind, endpoints[0].qos, parameters.peer)
    return Finding.as_asked(
        ", ".join(refusals(*pair)) or "every policy is compatible",
        Evidence(tables=(compatibility_table(*pair),)),
    )


def _why_otherwise(
    recording: Recording, parameters: Compatible, endpoint: Endpoint
) -> Finding | None:
    """Why an endpoint matches the peer, or does not, where the other is expected; or None."""
    kind, other = endpoint.kind.value, parameters.other
    pair = sides(endpoint.kind, endpoint.qos, parameters.peer)
    refused = refusals(*pair)
    left_open = _left_open(recording, endpoint, pair)
    own, mistake = f"the {kind} of {code(endpoint.node)}", "matches"
    if parameters.expect == "match":
        if not refused:
            return None
        observed = f"{own} does not match such a {other}: {', '.join(refused)}"
        mistake = "offers_less"
    elif not refused:
        observed = (
            f"{own} matches such a {other}: no policy that is offered is weaker than the one that "
            "is requested"
        )
    elif left_open:
        taken = ", ".join(str(getattr(endpoint.qos, policy)) for policy in left_open)
        observed = (
            f"{own} requests the best available {' and '.join(left_open)}, declared by the "
            "process. It then takes what the publishers offer when it is created, here "
            f"{taken}. Alone with such a publisher it would match"
        )
    else:
        return None
    moments, table = endpoints_seen(recording, (endpoint,)), compatibility_table(*pair)
    return mistaken(mistake, observed, Evidence(moments=moments, tables=(table,)), kind=kind)


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


def _profile_words(qos: Qos) -> str:
    words = [qos.reliability, qos.durability]
    if qos.liveliness == "manual_by_topic":
        words.append(qos.liveliness)
    durations = {"deadline": qos.deadline_s, "liveliness lease": qos.liveliness_lease_s}
    words += [f"{name} {item:g} s" for name, item in durations.items() if item is not None]
    return ", ".join(words)
