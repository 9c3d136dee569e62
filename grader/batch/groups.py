"""Groups of a course: who hands in together, where only one of them handed in."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

from grader.batch.batch import copy_result, with_teams
from grader.batch.collected import NOTHING, Collected
from grader.batch.ledger import Entry, Ledger
from grader.batch.used_assignment import load_used, refuse_changed
from grader.course.load import Course, written
from grader.findings.words import listing
from grader.spec.nearest_name import did_you_mean

_DIFFERENT = " of one group handed in different files"
_OF_A_GROUP = {"path", "sha256", "source", "fault", "late", "handed_in", "handed_in_from"}
R = TypeVar("R", bound=Entry)


def with_groups(rows: Sequence[R], course: Course | None) -> list[R]:
    """Rows in which a group has what the one of them handed in who did."""
    found = [_alone(row) for row in rows]
    rows = list(found)
    places = {written(row.key): at for at, row in enumerate(rows)}
    for group in course.spec.groups if course is not None else ():
        members = [places[name] for name in map(written, group) if name in places]
        handed = [at for at in members if _given(rows[at]) or rows[at].fault]
        paths = {_given(rows[at]) for at in handed}
        for at in members if len(paths) > 1 else ():
            names = listing([rows[one].key for one in handed])
            found[at] = rows[at].with_problem(f"{names}{_DIFFERENT}")
        for at in set(members) - set(handed) if len(paths) == 1 else ():
            row, other = rows[at], rows[handed[0]]
            parts = (part for part in row.problem.split("; ") if not part.startswith(NOTHING))
            row = replace(row, problem="; ".join(parts), shared_by=other.key)
            found[at] = replace(row, **{name: getattr(other, name) for name in _shared(row)})
    return found


def regroup(ledger: Ledger, course: Course) -> None:
    """Give the rows of a graded class what the groups of its rules share now; nothing is run."""
    before = ledger.read()
    earlier = {row.key: row for row in before.entries}
    rows = with_teams(with_groups(before.entries, course), earlier, ledger)
    if rows == list(before.entries):
        return
    loaded = load_used(ledger)
    given = [(row, ledger.result(row.shared_by)) for row in rows if row.shared_by]
    for _, result in given:
        if result is not None:
            refuse_changed(ledger.out, result.assignment.sha256, loaded)
    for row, result in given:
        if result is not None:
            copy_result(loaded, ledger, row.shared_by, row)
    ledger.write(rows, before.assignment, before.sha256, before.location, before.course)


def _given(row: Entry) -> object:
    """What tells the submission of a row: where it lies, or its hash once that is read."""
    return getattr(row, "path", None) or row.sha256


def _shared(row: Entry) -> list[str]:
    return [one.name for one in fields(row) if one.name in _OF_A_GROUP]


def _alone(row: R) -> R:
    """A row without what it has of its group."""
    parts = (part for part in row.problem.split("; ") if not part.endswith(_DIFFERENT))
    row = replace(row, problem="; ".join(parts))
    if not row.shared_by:
        return row
    nothing: dict[str, Any] = {
        one.name: one.default for one in fields(row) if one.name in _OF_A_GROUP
    }
    return replace(row, **nothing, shared_by="", team="").with_problem(NOTHING)


def strangers(rows: Sequence[Collected], course: Course) -> Iterator[str]:
    """Students that the rules name and that the class has not, a line each."""
    keys = [row.key for row in rows]
    known = {written(key) for key in keys}
    named = [("an extension", one.student) for one in course.spec.extensions]
    named += [("a group", member) for members in course.spec.groups for member in members]
    for what, name in dict.fromkeys(named):
        if written(name) not in known:
            nearest = did_you_mean(name, keys)
            yield f"{course.file}: {what} names {name!r}, not in this class.{nearest}"
