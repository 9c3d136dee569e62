"""Where the checks of a scenario want the robot to end, read from their parameters."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from typing import Any

from pydantic import TypeAdapter, ValidationError

from grader.assignment.model import Assignment, Visibility
from grader.findings.reference import Goal, GoalPose, UnknownValue
from grader.report.drawing.path import Target
from grader.spec.quantity import PositiveLength
from sim.motion import Pose

_GOAL: TypeAdapter[Goal] = TypeAdapter(GoalPose)
_LENGTH: TypeAdapter[float] = TypeAdapter(PositiveLength)
DEFAULT_M = 0.1


def targets(
    assignment: Assignment, scenario: str, values: Mapping[str, float]
) -> tuple[Target, ...]:
    """The goals that visible checks name for a scenario, each once."""
    found: dict[Pose, Target] = {}
    # A check that says how near goes before one that leaves it to the default.
    for check in sorted(assignment.checks, key=lambda check: "position" not in check.with_):
        judged = not check.scenarios or scenario in check.scenarios
        goal: Any = check.with_.get("goal")
        if goal is None or not judged or check.visibility is not Visibility.VISIBLE:
            continue
        # An author's own check may call something else a goal.
        with contextlib.suppress(ValidationError, UnknownValue):
            pose = _GOAL.validate_python(goal).pose(values)
            radius_m = _LENGTH.validate_python(check.with_.get("position", f"{DEFAULT_M} m"))
            found.setdefault(pose, Target(pose, radius_m))
    return tuple(found.values())
