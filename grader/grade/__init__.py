"""From findings to a grade: points, requirements, partial credit, whose fault it was. Pure."""

from grader.grade.judging import judge_all
from grader.grade.model import CheckResult, Grade, ScenarioFinding

__all__ = ["CheckResult", "Grade", "ScenarioFinding", "judge_all"]
