"""``result.json``: the grade for programs. Stable: a change of meaning raises ``schema``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from grader.errors import UsageError
from grader.findings.finding import Status
from grader.grade.model import CheckResult, Grade, ScenarioFinding
from grader.recording.model import NS, Recording
from grader.report.model import result_model as model
from grader.report.model.facts import RunFacts
from grader.report.model.mistakes import first_to_fix
from grader.report.model.remarks import remarks
from grader.report.model.result_model import SCHEMA, Result


def make_result(grade: Grade, recordings: Mapping[str, Recording], facts: RunFacts) -> Result:
    """Make the result of a grade.

    Args:
        recordings: By scenario id; may lack scenarios that were not run.
    """
    checks = tuple(map(_check, grade.results))
    submission = grade.submission
    return Result(
        schema_=SCHEMA,
        rosgrade_version=facts.rosgrade_version,
        assignment=model.AssignmentPart(
            id=grade.assignment.id,
            sha256=grade.assignment_sha256,
            location=grade.assignment_location,
        ),
        submission=model.SubmissionPart(
            id=submission.id, sha256=submission.sha256, problem=submission.problem
        ),
        score=grade.score if grade.graded else None,
        max_score=grade.max_score,
        graded=grade.graded,
        first_to_fix=first_to_fix(checks),
        checks=checks,
        withheld=model.WithheldPart(checks=grade.withheld.checks, points=grade.withheld.points),
        scenarios=tuple(
            _scenario(recordings[scenario.id], facts)
            for scenario in grade.assignment.scenarios
            if scenario.id in recordings
        ),
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
    missed = result.status in (Status.FAILED, Status.SKIPPED)
    return model.CheckPart(
        **_finding(decisive),
        id=result.id,
        title=result.title,
        points=result.points,
        max_points=result.max_points,
        visibility=result.visibility.value,
        author_hint="".join(result.hints[:1]) if missed else "",
        further_hints=result.hints[1:] if missed else (),
        waits_for=result.waits_for,
        other_scenarios=tuple(
            model.FindingPart(**_finding(item)) for item in result.findings if item is not decisive
        ),
    )


def _finding(item: ScenarioFinding) -> dict[str, Any]:
    return {
        "scenario": item.scenario,
        "traceback": item.traceback,
        **{
            name: getattr(item.finding, name)
            for name in model.FindingPart.model_fields
            if hasattr(item.finding, name)
        },
    }


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
