"""Groups of a course: who hands in together, where only one of them handed in."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from grader.batch.handed_in import HandedIn
from grader.course.load import Course, written
from grader.errors import UsageError
from grader.findings.wording import listing
from grader.spec.nearest_name import did_you_mean, nearest_or_all


def with_groups(rows: Sequence[HandedIn], course: Course | None) -> list[HandedIn]:
    """Rows in which a group has what the one of them handed in who did."""
    found = list(rows)
    for members in _groups(rows, course):
        handed = [at for at in members if rows[at].path is not None or rows[at].fault]
        paths = {rows[at].path for at in handed}
        for at in members if len(paths) > 1 else ():
            names = listing([rows[one].key for one in handed])
            found[at] = rows[at].with_problem(f"{names} of one group handed in different files")
        for at in members if len(paths) == 1 else ():
            if at not in handed:
                found[at] = _shared(rows[handed[0]], rows[at])
    return found


def _shared(handed: HandedIn, row: HandedIn) -> HandedIn:
    """The row of a member who has what another one handed in."""
    parts = [part for part in row.problem.split("; ") if not part.startswith("handed in nothing")]
    shared = replace(row, path=handed.path, fault=handed.fault, problem="; ".join(parts))
    return replace(shared, late=handed.late, time=handed.time, earlier=handed.earlier)


def strangers(rows: Sequence[HandedIn], course: Course) -> Iterator[str]:
    """Students that the rules name and that the class has not, a line each."""
    keys = [row.key for row in rows]
    known = {written(key) for key in keys}
    groups = course.spec.groups if isinstance(course.spec.groups, tuple) else ()
    named = [("an extension", one.student) for one in course.spec.extensions]
    named += [("a group", member) for members in groups for member in members]
    for what, name in dict.fromkeys(named):
        if written(name) not in known:
            nearest = did_you_mean(name, keys)
            yield f"{course.file}: {what} names {name!r}, not in this class.{nearest}"


def _groups(rows: Sequence[HandedIn], course: Course | None) -> list[list[int]]:
    groups = course.spec.groups if course is not None else None
    if course is None or groups is None:
        return []
    found: dict[str, list[int]] = {}
    if isinstance(groups, str):
        columns = {name for row in rows for name in row.columns}
        if groups.casefold() not in columns:
            nearest = nearest_or_all(groups, sorted(columns))
            raise UsageError(
                f"{course.file}: groups: the roster has no column {groups!r}.{nearest}"
            )
        names = [row.columns.get(groups.casefold(), "") for row in rows]
    else:
        of = {written(member): str(at) for at, members in enumerate(groups) for member in members}
        names = [of.get(written(row.key), "") for row in rows]
    for at, name in enumerate(names):
        if name:
            found.setdefault(name, []).append(at)
    return list(found.values())
