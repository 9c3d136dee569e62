"""A class of made submissions: full points, lost points, not built, not graded, nothing at all."""

from __future__ import annotations

from functools import cache

from grader.report.model.class_row import ClassRow
from grader.report.model.result_model import Result
from tests.report.sample import full_points, lost_points, not_built, not_graded


@cache
def _results() -> tuple[Result, ...]:
    return tuple(make().result for make in (full_points, lost_points, not_built, not_graded))


def classroom(size: int) -> list[ClassRow]:
    """Rows of a class; every tenth is not graded, and one of these has no result at all."""
    full, lost, broken, error = _results()
    rows = []
    for index in range(size):
        name = f"student {index:02}"
        if index == 9:
            rows.append(ClassRow(name, note="the archive is damaged"))
            continue
        result = error if index % 10 == 9 else (full, lost, lost, broken, full)[index % 5]
        rows.append(ClassRow(name, "", f"{name}/report.html", result, late=index % 7 == 3))
    return rows
