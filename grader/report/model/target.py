"""Where the checks of a scenario want the robot to be, read from their parameters."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping

from pydantic import TypeAdapter, ValidationError

from grader.assignment.model import Assignment, Visibility
from grader.checks.motion.route import Place
from grader.findings.reference import Goal, GoalPose, UnknownValue
from grader.report.drawing.path import Target
from grader.spec.quantity import PositiveLength
from sim.motion import Pose

_GOAL: TypeAdapter[Goal] = TypeAdapter(GoalPose)
_PLACES: TypeAdapter[tuple[Place, ...]] = TypeAdapter(tuple[Place, ...])
_LENGTH: TypeAdapter[float] = TypeAdapter(PositiveLength)
DEFAULT_M = 0.1


def targets(
    assignment: Assignment, scenario: str, values: Mapping[str, float]
) -> tuple[Target, ...]:
    """The goals and places that visible checks name for a scenario, each once."""
    found: dict[tuple[Pose, str], Target] = {}
    # A check that says how near goes before one that leaves it to the default.
    for check in sorted(assignment.checks, key=lambda check: "position" not in check.with_):
        judged = not check.scenarios or scenario in check.scenarios
        if not judged or check.visibility is not Visibility.VISIBLE:
            continue
        # An author's own check may call something else a goal, or a place.
        with contextlib.suppress(ValidationError, UnknownValue):
            radius_m = _LENGTH.validate_python(check.with_.get("position", f"{DEFAULT_M} m"))
            if "goal" in check.with_:
                pose = _GOAL.validate_python(check.with_["goal"]).pose(values)
                found.setdefault((pose, "goal"), Target(pose, radius_m))
            for number, place in enumerate(_PLACES.validate_python(check.with_.get("places", ()))):
                one = Target(_middle(place), radius_m, str(number + 1), place[2:] and place)
                found.setdefault((one.pose, one.label), one)
    return tuple(found.values())


def _middle(place: Place) -> Pose:
    return Pose((place[0] + place[-2]) / 2.0, (place[1] + place[-1]) / 2.0, 0.0)
