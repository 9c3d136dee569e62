"""Where the student's program creates what a finding is about: its publisher, its timer.

A process in Python declares these places itself; of one in C++ they are looked up in its source. No
verdict may depend on them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice

from grader.checks.check import Parameters
from grader.diagnosis.no_endpoint import PUBLISHER, SUBSCRIPTION
from grader.diagnosis.process.raised import submission_path
from grader.findings.finding import Finding
from grader.recording.model import Declaration, Recording
from grader.recording.submission import CPP, SourceError

_MOST = 3
_LONGEST_NAME = 200
# What a declaration is called by, and what it says.
_NAMES = {"node": "node", "timer": "callback"}
# Functions of rclcpp that create it.
_CREATED_BY = {
    "publisher": PUBLISHER.functions,
    "subscription": SUBSCRIPTION.functions,
    "timer": ("create_wall_timer", "create_timer"),
}
_WORDS = {"published": "messages on {} are published here"}


def with_origins(finding: Finding, parameters: Parameters, recording: Recording) -> Finding:
    """A finding that names no place, with the places of what it is about, as far as known.

    That is what the check names among its parameters, or what the finding says was observed.
    """
    if finding.evidence.places:
        return finding
    seen = finding.observed
    set_here = _fields_set(seen, recording) if "published" in parameters.about else ()
    places = dict.fromkeys((*set_here, *_places(seen, parameters, recording)))
    evidence = replace(finding.evidence, origins=tuple(islice(places, _MOST)))
    return replace(finding, evidence=evidence)


def _places(seen: str, parameters: Parameters, recording: Recording) -> Iterator[SourceError]:
    asked = _asked(parameters, recording)
    kinds = _kinds(parameters, asked, recording)
    declared = [one for kind in kinds if kind != "timer" for one in recording.declared(kind)]
    observed = [one for one in declared if f"`{_name(one)}`" in seen]
    # What was observed, and only without that what was asked for.
    found = observed or [one for one in declared if _name(one) in asked]
    timers = recording.declared("timer") if "timer" in kinds else ()
    for one in (*_timers_of(found, timers), *found):
        place = _place(one, recording)
        if place is not None:
            yield place


def _asked(parameters: Parameters, recording: Recording) -> set[str]:
    """The names among the parameters of a check: its topic, its node."""
    named = {value for _, value in parameters if isinstance(value, str)}
    is_of_robot = "published" in parameters.about and not hasattr(parameters, "topic")
    # The robot does what it is commanded.
    command = {recording.scene.command_topic} if recording.scene and is_of_robot else set()
    return named | command


def _kinds(parameters: Parameters, asked: set[str], recording: Recording) -> tuple[str, ...]:
    """The kinds of things that a check is about, such as its publisher and its timer."""
    kinds = tuple(kind for kind in parameters.about if kind in asked) or parameters.about
    published = {one.data.get("topic") for one in recording.declared("published")}
    if "published" in kinds and asked and not published & asked:
        # Nothing was published, and these are what should have done it.
        return (*kinds, "timer", "publisher")
    return kinds


def _timers_of(found: Sequence[Declaration], timers: Sequence[Declaration]) -> list[Declaration]:
    """The timers of the nodes that something else is of; of no other thing, all of them."""
    nodes = {one.data.get("node") for one in found}
    # A compiled process does not tell the node of a timer.
    return [one for one in timers if not nodes or one.data.get("node") in {*nodes, None}]


def _place(one: Declaration, recording: Recording) -> SourceError | None:
    """Where something that a process declares is created: as it says itself, or by its source."""
    words = _WORDS.get(one.kind, f"the {one.kind} {{}} is created here")
    line = one.data.get("line")
    path = submission_path(str(one.data.get("file")), recording.submission)
    if path and isinstance(line, int):
        return SourceError(path, line, words.format(_name(one)[:_LONGEST_NAME]))
    call = _call_in_cpp(one, recording) if "file" not in one.data else None
    if call is None:
        return None
    name = str(one.data.get("topic", ""))[:_LONGEST_NAME]
    return SourceError(*call, words.format(name).replace("  ", " "))


def _call_in_cpp(one: Declaration, recording: Recording) -> tuple[str, int] | None:
    """File and line of the call that creates something in C++, if only one can be meant.

    That is the call with the name, or the only one that has its name from elsewhere.
    """
    calls = [
        (file.path, call)
        for package in recording.submission.packages
        for file in package.sources
        for call in file.calls
        if file.language == CPP and call.short in _CREATED_BY.get(one.kind, ())
    ]
    topic = str(one.data.get("topic", ""))
    named = [(file, call) for file, call in calls if _is_named(topic, call.literal)]
    meant = named or [(file, call) for file, call in calls if not call.literal]
    return (meant[0][0], meant[0][1].line) if len(meant) == 1 else None


def _is_named(topic: str, written: str) -> bool:
    """Whether a topic may be what a name in the source stands for, in whatever namespace."""
    last = written.lstrip("~/")
    return bool(last) and f"/{topic}".endswith(f"/{last}")


def _name(one: Declaration) -> str:
    return str(one.data.get(_NAMES.get(one.kind, "topic")))


def _fields_set(seen: str, recording: Recording) -> Iterator[SourceError]:
    """Where the program assigns to a field that the finding says has another value."""
    for package in recording.submission.packages:
        for file in package.sources:
            for target, line in file.sets:
                # `msg.linear.x` sets `linear.x`, and `self.msg.linear.x` too.
                parts = target.split(".")
                ends = (".".join(parts[n:]) for n in range(1, len(parts)))
                field = next((one for one in ends if f" {one} = " in f" {seen}"), None)
                if field:
                    yield SourceError(file.path, line, f"{field} is set here")
