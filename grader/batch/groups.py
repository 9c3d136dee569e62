"""Groups of a course: who hands in together, where only one of them handed in."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from grader.batch.handed_in import NOTHING, HandedIn
from grader.course.load import Course, written
from grader.findings.wording import listing
from grader.spec.nearest_name import did_you_mean


def with_groups(rows: Sequence[HandedIn], course: Course | None) -> list[HandedIn]:
    """Rows in which a group has what the one of them handed in who did."""
    found = list(rows)
    places = {written(row.key): at for at, row in enumerate(rows)}
    for group in course.spec.groups if course is not None else ():
        members = [places[name] for name in map(written, group) if name in places]
        handed = [at for at in members if rows[at].path is not None or rows[at].fault]
        paths = {rows[at].path for at in handed}
        for at in members if len(paths) > 1 else ():
            names = listing([rows[one].key for one in handed])
            found[at] = rows[at].with_problem(f"{names} of one group handed in different files")
        for at in set(members) - set(handed) if len(paths) == 1 else ():
            row, other = rows[at], rows[handed[0]]
            parts = (part for part in row.problem.split("; ") if not part.startswith(NOTHING))
            row = replace(row, path=other.path, fault=other.fault, problem="; ".join(parts))
            found[at] = replace(row, late=other.late).at((other.handed_in, other.handed_in_from))
    return found


def strangers(rows: Sequence[HandedIn], course: Course) -> Iterator[str]:
    """Students that the rules name and that the class has not, a line each."""
    keys = [row.key for row in rows]
    known = {written(key) for key in keys}
    named = [("an extension", one.student) for one in course.spec.extensions]
    named += [("a group", member) for members in course.spec.groups for member in members]
    for what, name in dict.fromkeys(named):
        if written(name) not in known:
            nearest = did_you_mean(name, keys)
            yield f"{course.file}: {what} names {name!r}, not in this class.{nearest}"
