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

# What a report shows; a student's program may name things at any length.
_MOST_PLACES = 3
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
    observed = finding.observed
    places = list(_creations(observed, parameters, recording))
    if "published" in parameters.about:
        places = [*_assignments(observed, recording), *places]
    evidence = replace(finding.evidence, origins=tuple(islice(dict.fromkeys(places), _MOST_PLACES)))
    return replace(finding, evidence=evidence)


def _creations(
    observed: str, parameters: Parameters, recording: Recording
) -> Iterator[SourceError]:
    """Where the program creates what was observed, or without that what was asked for."""
    asked = _asked(parameters, recording)
    kinds = _kinds(parameters, asked, recording)
    declared = [one for kind in kinds if kind != "timer" for one in recording.declared(kind)]
    things = [one for one in declared if f"`{_name(one)}`" in observed]
    things = things or [one for one in declared if _name(one) in asked]
    timers = recording.declared("timer") if "timer" in kinds else ()
    for declaration in (*_timers_of(things, timers), *things):
        place = _place(declaration, recording)
        if place is not None:
            yield place


def _asked(parameters: Parameters, recording: Recording) -> set[str]:
    """The names among the parameters of a check: its topic, its node."""
    names = {value for _, value in parameters if isinstance(value, str)}
    is_of_robot = "published" in parameters.about and not hasattr(parameters, "topic")
    if recording.scene is not None and is_of_robot:
        # The robot does what it is commanded.
        names.add(recording.scene.command_topic)
    return names


def _kinds(parameters: Parameters, asked: set[str], recording: Recording) -> tuple[str, ...]:
    """The kinds of things that a check is about, such as its publisher and its timer."""
    kinds = tuple(kind for kind in parameters.about if kind in asked) or parameters.about
    published = {one.data.get("topic") for one in recording.declared("published")}
    if "published" in kinds and asked and not published & asked:
        # Nothing was published, and these are what should have done it.
        return (*kinds, "timer", "publisher")
    return kinds


def _timers_of(things: Sequence[Declaration], timers: Sequence[Declaration]) -> list[Declaration]:
    """The timers of the nodes that have some things; without any such thing, all of them."""
    nodes = {one.data.get("node") for one in things}
    # A compiled process does not tell the node of a timer.
    return [one for one in timers if not nodes or one.data.get("node") in {*nodes, None}]


def _place(declaration: Declaration, recording: Recording) -> SourceError | None:
    """Where something that a process declares is created: as it says itself, or by its source."""
    kind, data = declaration.kind, declaration.data
    words = _WORDS.get(kind, f"the {kind} {{}} is created here")
    path, line = submission_path(str(data.get("file")), recording.submission), data.get("line")
    if path and isinstance(line, int):
        return SourceError(path, line, words.format(_name(declaration)[:_LONGEST_NAME]))
    call = _call_in_cpp(declaration, recording) if "file" not in data else None
    if call is None:
        return None
    # A timer has no name: its words would have two blanks.
    name = str(data.get("topic", ""))[:_LONGEST_NAME]
    return SourceError(*call, words.format(name).replace("  ", " "))


def _call_in_cpp(declaration: Declaration, recording: Recording) -> tuple[str, int] | None:
    """File and line of the call that creates something in C++, if only one can be meant.

    That is the call with the name, or the only one that has its name from elsewhere.
    """
    functions, topic = _CREATED_BY.get(declaration.kind, ()), str(declaration.data.get("topic", ""))
    with_name, without_name = [], []
    for package in recording.submission.packages:
        for file in package.sources:
            for call in file.calls if file.language == CPP else ():
                if call.short in functions and _is_named(topic, call.literal):
                    with_name.append((file.path, call.line))
                elif call.short in functions and not call.literal:
                    without_name.append((file.path, call.line))
    candidates = with_name or without_name
    return candidates[0] if len(candidates) == 1 else None


def _is_named(topic: str, written: str) -> bool:
    """Whether a topic may be what a name in the source stands for, in whatever namespace."""
    last = written.lstrip("~/")
    return bool(last) and f"/{topic}".endswith(f"/{last}")


def _name(declaration: Declaration) -> str:
    return str(declaration.data.get(_NAMES.get(declaration.kind, "topic")))


def _assignments(observed: str, recording: Recording) -> Iterator[SourceError]:
    """Where the program assigns to a field that the finding says has another value."""
    for package in recording.submission.packages:
        for file in package.sources:
            for target, line in file.sets:
                # `msg.linear.x` sets `linear.x`, and `self.msg.linear.x` too.
                parts = target.split(".")
                fields = [".".join(parts[begin:]) for begin in range(1, len(parts))]
                said = [field for field in fields if f" {field} = " in f" {observed}"]
                if said:
                    yield SourceError(file.path, line, f"{said[0]} is set here")
