"""``result.json``: the grade for programs. Stable: a change of meaning raises ``schema``.

The same submission graded again, on a busier machine or beside other submissions, gets the same
grade, byte for byte. Times, paths, logs, observed figures and the evidence that holds
them are measurements: they are never twice the same.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Mapping
from difflib import unified_diff
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from grader.checks.topic.topic import Untouched
from grader.errors import UsageError
from grader.findings.finding import Status
from grader.findings.words import code, codes, counted
from grader.grade.model import CheckResult, Grade, ScenarioFinding
from grader.measure.transforms import TRANSFORMS
from grader.recording.model import NS, PROBE_NODE, Kind, Owner, Recording
from grader.report.model import result_model as model
from grader.report.model.facts import RunFacts
from grader.report.model.mistakes import first_to_fix
from grader.report.model.result_model import SCHEMA, Result

_FLOOD = 1000
"""Messages within a second on one topic; the fastest sensors send fewer."""


def make_result(grade: Grade, recordings: Mapping[str, Recording], facts: RunFacts) -> Result:
    """Make the result of a grade.

    Args:
        recordings: By scenario id; may lack scenarios that were not run.
    """
    checks = tuple(map(_check, grade.results))
    submission, withheld = grade.submission, grade.loaded.withheld
    return Result(
        schema_=SCHEMA,
        rosgrade_version=facts.rosgrade_version,
        assignment=model.AssignmentPart(
            id=grade.assignment.id,
            sha256=grade.loaded.sha256,
            location=grade.loaded.location,
        ),
        submission=model.SubmissionPart(
            id=submission.id, sha256=submission.sha256, problem=submission.problem
        ),
        score=grade.score if grade.graded else None,
        max_score=grade.max_score,
        graded=grade.graded,
        first_to_fix=first_to_fix(checks),
        checks=checks,
        withheld=model.WithheldPart(checks=withheld.checks, points=withheld.points),
        scenarios=tuple(
            _scenario(recordings[scenario.id], facts)
            for scenario in grade.assignment.scenarios
            if scenario.id in recordings
        ),
        names=tuple(model.NamePart(**vars(one)) for one in grade.chosen),
        build=submission.build,
        environment=dict(sorted(facts.environment.items())),
        started=facts.started,
        duration_s=facts.duration_s,
        adjustments=tuple(
            model.AdjustmentPart(
                kind="manual", title=one.title, points=None, max_points=one.points, item=one.id
            )
            for one in grade.assignment.manual
        ),
    )


def result_json(result: Result) -> str:
    """Write a result as JSON; keys are always in the same order."""
    return result.model_dump_json(by_alias=True, indent=2) + "\n"


def read_result(file: Path) -> Result:
    """Read a ``result.json`` of the schema that this rosgrade writes."""
    try:
        return Result.model_validate_json(file.read_bytes())
    except OSError as error:
        raise UsageError(f"{file} cannot be read: {error.strerror}") from error
    except ValidationError as error:
        first = error.errors()[0]
        why = ": ".join([*map(str, first["loc"]), first["msg"]])
        raise UsageError(f"{file} is not a result that this rosgrade reads: {why}") from error


def result_schema() -> dict[str, Any]:
    """The JSON Schema of ``result.json``."""
    return Result.model_json_schema(schema_generator=model.ResultSchema, mode="serialization")


def _check(result: CheckResult) -> model.CheckPart:
    decisive = result.decisive
    hints = result.hints if result.status in (Status.FAILED, Status.SKIPPED) else ()
    return model.CheckPart(
        **_finding(decisive),
        id=result.id,
        title=result.title,
        points=result.points,
        max_points=result.max_points,
        visibility=result.visibility.value,
        author_hint=hints[0] if hints else "",
        further_hints=hints[1:],
        waits_for=result.waits_for,
        other_scenarios=tuple(
            model.FindingPart(**_finding(other))
            for other in result.findings
            if other is not decisive
        ),
    )


def _finding(finding: ScenarioFinding) -> dict[str, Any]:
    """The fields of a :class:`FindingPart`: those of the finding, and what is known of its run."""
    of_run = {"scenario": finding.scenario, "traceback": finding.traceback}
    names = model.FindingPart.model_fields.keys() - of_run.keys()
    return {**of_run, **{name: getattr(finding.finding, name) for name in names}}


def _scenario(recording: Recording, facts: RunFacts) -> model.ScenarioPart:
    name, begin, end = recording.scenario, recording.launched_ns, recording.end_ns
    return model.ScenarioPart(
        id=name,
        seed=recording.seed,
        recording=facts.recordings.get(name),
        ending=recording.ending.value,
        duration_s=(end - begin) / NS,
        disturbance=model.DisturbancePart(
            taken_s=recording.stolen_s(begin, end),
            worst_late_s=max((item.late_ns for item in recording.disturbance), default=0) / NS,
        ),
        faults=recording.faults,
        breaches=tuple(map(str, recording.breaches)),
        remarks=remarks(recording),
        runs=facts.runs.get(name, 1),
    )


def remarks(recording: Recording) -> tuple[str, ...]:
    """Say what is conspicuous about a run, one sentence each.

    A limit of the sandbox that was reached is reported elsewhere (``Recording.breaches``).
    """
    if recording.bag is not None:
        return tuple(f"the bag {code(recording.bag)}: {note}" for note in recording.bag_notes)
    return (
        *_corrected_names(recording),
        *_imitations(recording),
        *_excess(recording),
        *_forged_reports(recording),
        *_unlisted_modules(recording),
        *_forged_truth(recording),
    )


def _corrected_names(recording: Recording) -> Iterator[str]:
    if recording.names:
        wrong = codes(map(str, recording.names.wrong))
        yield (f"this run corrected wrong names, so that everything else could be judged: {wrong}")


def _imitations(recording: Recording) -> Iterator[str]:
    """Names of the probe and topics of the robot, unless the assignment asks for them."""
    for node in recording.student_nodes:
        if node.name.rpartition("/")[2] == PROBE_NODE:
            name = code(node.name)
            yield f"a node of the submission is called {name}, like the node that watches the run"
    topics_of_robots = set(Untouched().topics)
    if recording.scene is None:
        # Without a robot, what the probe listens to is asked for.
        topics_of_robots -= {e.topic for e in recording.endpoints if e.owner is Owner.PROBE}
    topics_by_node: dict[str, set[str]] = {}
    for endpoint in recording.student_endpoints(Kind.PUBLISHER):
        # A robot is not the only one to publish transforms.
        if endpoint.topic in topics_of_robots and endpoint.type != TRANSFORMS:
            topics_by_node.setdefault(endpoint.node, set()).add(endpoint.topic)
    for node_name, topics in sorted(topics_by_node.items()):
        yield f"the node {code(node_name)} publishes on {codes(sorted(topics))}, which robots do"


def _excess(recording: Recording) -> Iterator[str]:
    """Another domain, and more messages or output than a robot needs."""
    others = recording.environment.get("other_domains")
    if others:
        yield f"the submission joined another ROS domain: {others}"
    for topic in recording.messages:
        most = _most_within_a_second(recording, topic)
        if most > _FLOOD:
            yield f"{most} messages were sent on {code(topic)} within 1 s"
    for process in recording.processes:
        if process.dropped_bytes:
            left_out = counted(process.dropped_bytes, "byte")
            yield f"{code(process.name)} printed {left_out} more than rosgrade keeps"


def _most_within_a_second(recording: Recording, topic: str) -> int:
    """The largest number of messages that were sent on a topic within a second."""
    messages = recording.messages[topic]
    times = [message.stamp_ns for message in messages]
    numbers = list(range(len(messages)))
    if len(recording.student_endpoints(Kind.PUBLISHER, topic)) == 1:
        # A publisher numbers its messages: of a flood most are lost on the way.
        numbers = [message.sequence for message in messages]
    most = 0
    for first, time_ns in enumerate(times):
        last = bisect_left(times, time_ns + NS) - 1
        most = max(most, numbers[last] - numbers[first] + 1)
    return most


def _forged_reports(recording: Recording) -> Iterator[str]:
    if any(breach.what == "forged report" for breach in recording.breaches):
        return
    for process in dict.fromkeys(item.process for item in recording.declared("foreign")):
        yield (
            f"{code(process)} wrote into the channel through which rosgrade reports from "
            "inside a process; such a report is never proof"
        )


def _unlisted_modules(recording: Recording) -> Iterator[str]:
    """Libraries of Python that are perhaps missing where a class is graded."""
    modules = recording.environment.get("unlisted", "").split()
    if modules:
        has_none = recording.environment.get("sandbox", "none") == "none"
        here = "without a sandbox" if has_none else "in the system's Python, as ROS is sourced"
        yield (
            f"the code imports {codes(modules)}, found {here}: elsewhere, Python has only "
            "the standard library, ROS 2, `numpy`, and what the assignment allows"
        )


def _forged_truth(recording: Recording) -> Iterator[str]:
    for incident in recording.incidents:
        if incident.kind == "forged_truth":
            yield (
                f"{incident.text}: only what the simulator of the assignment publishes there "
                "counts as the truth"
            )


_FINDING = frozenset({"scenario", "status", "expected", "hint", "concept", "asks"})
_CHECK = _FINDING | {
    "id",
    "title",
    "points",
    "max_points",
    "visibility",
    "author_hint",
    "further_hints",
    "waits_for",
}
GRADE: dict[str, Any] = {
    "assignment": {"id", "sha256"},
    # Its name is not among it: the same submission of another student gets the same grade.
    "submission": {"sha256", "problem"},
    "score": True,
    "max_score": True,
    "graded": True,
    "first_to_fix": True,
    "checks": {
        "__all__": {**dict.fromkeys(_CHECK, True), "other_scenarios": {"__all__": set(_FINDING)}}
    },
    "withheld": True,
    "scenarios": {"__all__": {"id", "seed"}},
    "names": True,
    "build": {"succeeded", "failed_packages"},
}
"""What of the model :class:`Result` is the grade, as pydantic's ``include``."""


def grade_json(result: Result) -> str:
    """The grade of a result as JSON; keys are always in the same order."""
    return result.model_dump_json(by_alias=True, include=GRADE, indent=2) + "\n"


def differences(one: str, other: str) -> list[str]:
    """The lines that differ between two grades, with the lines around them."""
    return list(unified_diff(one.splitlines(), other.splitlines(), lineterm=""))
