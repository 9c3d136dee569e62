"""Where the checks of a scenario want the robot to end, read from their parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import TypeAdapter, ValidationError

from grader.assignment.model import Assignment, CheckSpec, Visibility
from grader.checks.reference import Goal, GoalPose, UnknownValue
from grader.report.drawing.path import Target
from grader.spec.quantity import PositiveLength

_GOAL: TypeAdapter[Goal] = TypeAdapter(GoalPose)
_LENGTH: TypeAdapter[float] = TypeAdapter(PositiveLength)
DEFAULT_M = 0.1


def targets(
    assignment: Assignment, scenario: str, values: Mapping[str, float]
) -> tuple[Target, ...]:
    """The goals that visible checks name for a scenario, each once."""
    found: dict[tuple[float, float, float], Target] = {}
    # The first that says how near goes before one that leaves it to the default.
    for check in sorted(assignment.checks, key=lambda check: "position" not in check.with_):
        judged = not check.scenarios or scenario in check.scenarios
        if judged and check.visibility is Visibility.VISIBLE:
            target = _target(check, values)
            if target is not None:
                pose = target.pose
                found.setdefault((pose.x_m, pose.y_m, pose.yaw_rad), target)
    return tuple(found.values())


def _target(check: CheckSpec, values: Mapping[str, float]) -> Target | None:
    given: Any = check.with_.get("goal")
    if given is None:
        return None
    try:
        pose = _GOAL.validate_python(given).pose(values)
        radius_m = _LENGTH.validate_python(check.with_.get("position", f"{DEFAULT_M} m"))
    # An author's own check may call something else a goal.
    except (ValidationError, UnknownValue):
        return None
    return Target(pose, radius_m)
