"""Groups of a course: who hands in together, where only one of them handed in.

Where ana and ben are a group and only ana handed in, ben's row gets what ana handed in, and
``shared_by`` says so. Where both handed in different files, both rows say that instead.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TypeVar

from grader.batch.batch import copy_result, with_teams
from grader.batch.collected import NOTHING, Collected
from grader.batch.ledger import Entry, Ledger
from grader.batch.used_assignment import load_used, refuse_changed
from grader.course.load import Course, comparable_name
from grader.findings.words import listing
from grader.spec.nearest_name import did_you_mean

_DIFFERENT = " of one group handed in different files"
R = TypeVar("R", bound=Entry)


def with_groups(rows: Sequence[R], course: Course | None) -> list[R]:
    """Rows in which a group has what the one of them handed in who did."""
    row_of_key = {row.key: _alone(row) for row in rows}
    key_of_name = {comparable_name(key): key for key in row_of_key}
    groups = course.spec.groups if course is not None else ()
    for group in groups:
        names = [comparable_name(member) for member in group]
        members = [row_of_key[key_of_name[name]] for name in names if name in key_of_name]
        row_of_key.update({row.key: row for row in _sharing(members)})
    return list(row_of_key.values())


def _alone(row: R) -> R:
    """A row without what it has of its group: what others handed in, and what was said of that."""
    row = row.without_problem(lambda problem: problem.endswith(_DIFFERENT))
    if not row.shared_by:
        return row
    empty = type(row)(row.key)
    return replace(row, **empty.handed_in_fields, shared_by="", team="").with_problem(NOTHING)


def _sharing(members: Sequence[R]) -> list[R]:
    """The rows of one group, in which each has what one of them handed in."""
    givers = [row for row in members if row.submission or row.fault]
    if len({row.submission for row in givers}) > 1:
        problem = f"{listing([row.key for row in givers])}{_DIFFERENT}"
        return [row.with_problem(problem) for row in members]
    if not givers:
        return list(members)
    return [row if row in givers else _receiving(row, givers[0]) for row in members]


def _receiving(row: R, giver: R) -> R:
    row = row.without_problem(lambda problem: problem.startswith(NOTHING))
    return replace(row, **giver.handed_in_fields, shared_by=giver.key)


def regroup(ledger: Ledger, course: Course) -> None:
    """Give the rows of a graded class what the groups of its rules share now; nothing is run."""
    before = ledger.read()
    earlier = {row.key: row for row in before.entries}
    rows = with_teams(with_groups(before.entries, course), earlier, ledger)
    if rows == list(before.entries):
        return
    loaded = load_used(ledger)
    receivers = []
    for row in rows:
        result = ledger.result(row.shared_by) if row.shared_by else None
        if result is not None:
            refuse_changed(ledger.out, result.assignment.sha256, loaded)
            receivers.append(row)
    # Only after none was refused: the class has either all of its new groups, or none.
    for row in receivers:
        copy_result(loaded, ledger, row.shared_by, row)
    ledger.write(rows, before.assignment, before.sha256, before.location, before.course)


def unknown_students(rows: Sequence[Collected], course: Course) -> Iterator[str]:
    """Students that the rules name and that the class has not, a line each."""
    keys = [row.key for row in rows]
    known_names = {comparable_name(key) for key in keys}
    mentions = [("an extension", extension.student) for extension in course.spec.extensions]
    mentions += [("a group", member) for members in course.spec.groups for member in members]
    for where, name in dict.fromkeys(mentions):
        if comparable_name(name) not in known_names:
            nearest = did_you_mean(name, keys)
            yield f"{course.file}: {where} names {name!r}, not in this class.{nearest}"
