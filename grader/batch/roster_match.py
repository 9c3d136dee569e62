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
        stems_with: Counter[str] = Counter()
        for stem in stems:
            hyphens = [at for at, character in enumerate(stem) if character == "-"]
            stems_with.update(stem[: at + 1] for at in hyphens)
        most = max(stems_with.values(), default=0)
        if most <= max(1, len(stems) / 2):
            return ""
        logins_behind = {
            prefix: len([stem for stem in stems if self._login_behind(prefix, stem)])
            for prefix, count in stems_with.items()
            if count == most
        }
        fitting = [prefix for prefix, count in logins_behind.items() if count]
        if len(fitting) != 1:
            return ""
        is_sure = len(logins_behind) == 1 or logins_behind[fitting[0]] > 1
        return fitting[0] if is_sure else ""

    def exact(self, entry: Collected) -> set[str]:
        """Students with exactly its names; several where two of its names contradict each other."""
        keys: set[str] = set()
        for name in entry.names:
            of_name = {
                student.key
                for form in name_forms(name)
                for student in self._alike.get(resemblance(form), ())
                if comparable_name(form) in student.logins | student.names
            }
            keys = (keys & of_name) or (keys | of_name)
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
    stated = _stated(roster)
    students = {student.key: student for student in roster.students}
    rows: list[Collected] = []
    # Key of a student -> which rows hold what the student handed in, and what else may be theirs.
    indices: dict[str, list[int]] = {}
    doubtful: dict[str, list[str]] = {}
    for entry in entries:
        # What the roster says itself needs no guess, and a team may have handed in one for all.
        keys = stated.get(entry.item.name, set()) | stated.get(stem_of(entry.item), set())
        is_sure = bool(keys)
        if not is_sure:
            keys = names.exact(entry)
            is_sure = len(keys) == 1
        if is_sure:
            for key in sorted(keys):
                indices.setdefault(key, []).append(len(rows))
                rows.append(entry.of(students[key]))
            continue
        candidates = sorted(keys or names.alike(entry))
        for key in candidates:
            doubtful.setdefault(key, []).append(shown(entry.item.name))
        why = "" if keys else "not in the roster"
        may_be = f"may be {listing(candidates, 'or')}" if candidates else ""
        rows.append(entry.with_problem(why, may_be))
    for key, of_student in indices.items():
        _note_others(rows, of_student, doubtful.get(key, []))
    absent = (student for student in roster.students if student.key not in indices)
    rows += [_row_of_absent(student, doubtful.get(student.key, [])) for student in absent]
    return rows


def _stated(roster: Roster) -> dict[str, set[str]]:
    """Names of files that the roster itself says -> keys of the students that it says them of."""
    keys: dict[str, set[str]] = {}
    for student in roster.students:
        if student.submission:
            file = PurePosixPath(student.submission).name.removesuffix(".git")
            keys.setdefault(file, set()).add(student.key)
    return keys


def _note_others(rows: list[Collected], indices: list[int], doubtful: list[str]) -> None:
    """Note on the rows of a student what else may be of that student."""
    files = [shown(rows[index].item.name) for index in indices]
    for index, file in zip(indices, files, strict=True):
        if len(files) > 1:
            others = [other for other in files[:_MOST_TWICE] if other != file] or [file]
            rows[index] = rows[index].with_problem(f"handed in twice: {listing(others)} too")
        if doubtful:
            rows[index] = rows[index].with_problem(f"{listing(doubtful)} may be theirs too")


def _row_of_absent(student: Student, doubtful: list[str]) -> Collected:
    why = NOTHING
    if student.submission:
        why += f": {shown(student.submission)} is not among the submissions"
    may_be = f"{listing(doubtful)} may be theirs" if doubtful else ""
    return Collected("").with_problem(why, may_be).of(student)


def unique(rows: list[Collected]) -> list[Collected]:
    """Rows sorted by key, with a number behind a key that is there already."""
    # A browser numbers what it saves in the same way, so `ana (2)` may be there as well.
    taken = {row.key for row in rows}
    counts: dict[str, int] = {}
    numbered = []
    for row in sorted(rows, key=lambda row: row.key):
        key, number = row.key, counts.get(row.key, 0) + 1
        while number > 1 and (key := f"{row.key} ({number})") in taken:
            number += 1
        counts[row.key] = number
        taken.add(key)
        numbered.append(replace(row, key=key))
    return numbered
