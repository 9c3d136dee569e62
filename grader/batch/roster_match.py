"""Which student of a roster handed in what, by the names of files and folders."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import PurePosixPath

from grader.batch.collected import NOTHING, Collected, stem_of
from grader.batch.roster import Roster, Student, name_forms, resemblance
from grader.course.load import comparable_name
from grader.findings.words import listing
from grader.submission.intake.paths import shown

# Parts of a repository's name that are compared; real names have fewer.
_MOST_HYPHENS = 12
_MOST_TWICE = 10


class _Names:
    """Finds the students of a roster that an entry may belong to."""

    def __init__(self, students: Sequence[Student], entries: Sequence[Collected]) -> None:
        """Collect the names of a class."""
        self._alike: dict[str, list[Student]] = {}
        for student in students:
            for form in student.resembling:
                self._alike.setdefault(form, []).append(student)
        self._prefix = self._find_prefix([stem_of(entry.item) for entry in entries])

    def _find_prefix(self, stems: Sequence[str]) -> str:
        """GitHub Classroom's ``<assignment>-``, where both that and logins may hold hyphens.

        It is the beginning that most of the names share. If they share several, it is the only one
        that logins of the roster follow, in two names at least.
        """
        hyphens = ((stem, at) for stem in stems for at, sign in enumerate(stem) if sign == "-")
        shared = Counter(stem[: at + 1] for stem, at in hyphens)
        most = max(shared.values(), default=0)
        if most <= max(1, len(stems) / 2):
            return ""
        known = {
            prefix: sum(bool(self._login_behind(prefix, stem)) for stem in stems)
            for prefix, count in shared.items()
            if count == most
        }
        fitting = [prefix for prefix, count in known.items() if count]
        is_sure = len(fitting) == 1 and (len(known) == 1 or known[fitting[0]] > 1)
        return fitting[0] if is_sure else ""

    def exact(self, entry: Collected) -> set[str]:
        """Students with exactly its names; several where two of its names contradict each other."""
        keys: set[str] = set()
        for name in entry.names:
            found = {
                student.key
                for form in name_forms(name)
                for student in self._alike.get(resemblance(form), ())
                if comparable_name(form) in student.logins or comparable_name(form) in student.names
            }
            keys = keys & found or keys | found
        return keys or self._login_behind(self._prefix, stem_of(entry.item))

    def alike(self, entry: Collected) -> set[str]:
        """Students with a name that is written alike, or with which the entry's name ends."""
        parts = stem_of(entry.item).split("-")[-_MOST_HYPHENS:]
        ends = ["-".join(parts[first:]) for first in range(1, len(parts))]
        forms = map(resemblance, (*entry.names, *ends))
        return {student.key for form in forms for student in self._alike.get(form, ())}

    def _login_behind(self, prefix: str, stem: str) -> set[str]:
        """The student whose login stands behind the prefix of a repository's name."""
        login = stem.removeprefix(prefix)
        alike = self._alike.get(resemblance(login), ()) if login != stem else ()
        return {student.key for student in alike if comparable_name(login) in student.logins}


def matched(entries: list[Collected], roster: Roster) -> list[Collected]:
    """Give each entry to the student of the roster that it names.

    A name that is only similar is not matched; the rows of submission and student say so.
    """
    names = _Names(roster.students, entries)
    named: dict[str, set[str]] = {}
    students = {student.key: student for student in roster.students}
    for student in roster.students:
        if student.submission:
            file = PurePosixPath(student.submission).name.removesuffix(".git")
            named.setdefault(file, set()).add(student.key)
    rows: list[Collected] = []
    handed: dict[str, list[tuple[int, str]]] = {}
    doubtful: dict[str, list[str]] = {}
    for entry in entries:
        # What the roster says itself needs no guess, and a team may have handed in one for all.
        stated = named.get(entry.item.name, set()) | named.get(stem_of(entry.item), set())
        keys = stated or names.exact(entry)
        if not stated and len(keys) != 1:
            may_be = sorted(keys or names.alike(entry))
            for key in may_be:
                doubtful.setdefault(key, []).append(shown(entry.item.name))
            why = "" if keys else "not in the roster"
            theirs = f"may be {listing(may_be, 'or')}" if may_be else ""
            rows.append(entry.with_problem(why, theirs))
            continue
        for key in sorted(keys):
            handed.setdefault(key, []).append((len(rows), shown(entry.item.name)))
            rows.append(entry.of(students[key]))
    for key, found in handed.items():
        for at, file in found if len(found) > 1 else ():
            others = [other for _, other in found[:_MOST_TWICE] if other != file] or [file]
            rows[at] = rows[at].with_problem(f"handed in twice: {listing(others)} too")
        for at, _ in found if key in doubtful else ():
            rows[at] = rows[at].with_problem(f"{listing(doubtful[key])} may be theirs too")
    for student in roster.students:
        if student.key not in handed:
            why = NOTHING
            if student.submission:
                why += f": {shown(student.submission)} is not among the submissions"
            other = doubtful.get(student.key)
            theirs = f"{listing(other)} may be theirs" if other else ""
            rows.append(Collected("").with_problem(why, theirs).of(student))
    return rows


def unique(rows: list[Collected]) -> list[Collected]:
    """Rows sorted by key, with a number behind a key that is there already."""
    # A browser numbers what it saves in the same way, so `ana (2)` may be there as well.
    taken = {row.key for row in rows}
    counts: dict[str, int] = {}
    found = []
    for row in sorted(rows, key=lambda item: item.key):
        key, number = row.key, counts.get(row.key, 0) + 1
        while number > 1 and (key := f"{row.key} ({number})") in taken:
            number += 1
        counts[row.key] = number
        taken.add(key)
        found.append(replace(row, key=key))
    return found
