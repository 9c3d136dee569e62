"""``course.yaml`` from a file, with everything that must fit together in it."""

from __future__ import annotations

import unicodedata
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

from grader.assignment.model import Visibility
from grader.course.instant import instant, later
from grader.course.model import Attempts, CourseFile, Late
from grader.errors import AssignmentError, UsageError
from grader.spec.document import Place
from grader.spec.nearest_name import nearest_or_all
from grader.spec.source import Source, in_order, read_source

COURSE_FILE = "course.yaml"
Mistakes = Iterator[tuple[Place, str]]


@dataclass(frozen=True)
class Rules:
    """The rules for what one student hands in for one assignment.

    Attributes:
        due: With the student's extension; ``due_of_all`` is without.
        closes: Later hand-ins count nothing; None for never.
    """

    due: datetime
    due_of_all: datetime
    closes: datetime | None
    late: Late | None
    attempts: Attempts | None


@dataclass(frozen=True)
class Course:
    """The rules of a course, all of which fit together."""

    file: Path
    spec: CourseFile

    def rules(self, assignment: str, student: str = "") -> Rules:
        """The rules for a student; an assignment that is not in the file is an error."""
        if assignment not in self.spec.assignments:
            nearest = nearest_or_all(assignment, self.spec.assignments)
            raise UsageError(f"{self.file}: has no assignment {assignment!r}.{nearest}")
        one = self.spec.assignments[assignment]
        due = due_of_all = self.instant(one.due)
        for each in self.spec.extensions:
            if (each.assignment, comparable_name(each.student)) == (
                assignment,
                comparable_name(student),
            ):
                if each.due:
                    due = self.instant(each.due)
                elif each.tokens and self.spec.tokens:
                    due = later(due_of_all, each.tokens, self.spec.tokens.worth)
                else:
                    due = later(due_of_all, each.days or 0, "day")
        return Rules(
            due=due,
            due_of_all=due_of_all,
            closes=max(self.instant(one.closes), due) if one.closes else None,
            late=one.late or self.spec.late,
            attempts=one.attempts or self.spec.attempts,
        )

    def visible(self, assignment: str, now: datetime) -> frozenset[str]:
        """Which checks students may see at a time, by their visibility.

        Those of ``after_due_date`` are shown when the due time has passed for all, also with an
        extension, and the assignment is closed.
        """
        students = [one.student for one in self.spec.extensions if one.assignment == assignment]
        rules = [self.rules(assignment, student) for student in ("", *students)]
        shown = {Visibility.VISIBLE.value}
        if now >= max(one.closes or one.due for one in rules) + timedelta(minutes=1):
            shown.add(Visibility.AFTER_DUE_DATE.value)
            published = self.spec.assignments[assignment].published
            if published and now >= self.instant(published):
                shown.add(Visibility.AFTER_PUBLISHED.value)
        return frozenset(shown)

    def instant(self, text: str) -> datetime:
        """The point in time that a text means in the course's time zone."""
        return instant(text, self.spec.time_zone)


def comparable_name(text: str) -> str:
    """A name as it is compared: case, spaces around it and an accent's encoding do not matter."""
    return " ".join(unicodedata.normalize("NFKC", text).casefold().split())


def load_course(file: Path) -> Course:
    """Read the rules of a course; every mistake in them is named with its line."""
    source = read_source(file)
    course = Course(file, source.read(CourseFile))
    found = [*_times(course)] or [*_contradictions(course)]
    found += [*_groups(source, course.spec), *_extensions(source, course.spec)]
    if found:
        raise AssignmentError(file, in_order(source.problem(*one) for one in found))
    return course


def _times(course: Course) -> Mistakes:
    times: list[tuple[Place, str | None]] = [
        (("assignments", name, key), getattr(one, key))
        for name, one in course.spec.assignments.items()
        for key in ("due", "closes", "published")
    ]
    times += [(("extensions", at, "due"), one.due) for at, one in enumerate(course.spec.extensions)]
    for place, text in times:
        try:
            _ = text and course.instant(text)
        except ValueError as error:
            yield place, str(error)
            if course.spec.time_zone is None:
                # One line at the top corrects all of them.
                return


def _contradictions(course: Course) -> Mistakes:
    for name, one in course.spec.assignments.items():
        for key, text in (("closes", one.closes), ("published", one.published)):
            if text and course.instant(text) < course.instant(one.due):
                yield ("assignments", name, key), f"is before the due time, {one.due}"
    for at, extension in enumerate(course.spec.extensions):
        own = course.spec.assignments.get(extension.assignment)
        if own and extension.due and course.instant(extension.due) <= course.instant(own.due):
            yield ("extensions", at, "due"), f"is not later than the due time of all, {own.due}"


def _groups(source: Source, spec: CourseFile) -> Mistakes:
    seen: dict[str, Place] = {}
    for at, members in enumerate(spec.groups):
        for number, member in enumerate(members):
            place: Place = ("groups", at, number)
            first = seen.setdefault(comparable_name(member), place)
            if first != place:
                yield place, f"{member!r} is in a group already (line {source.line(first)})"


def _extensions(source: Source, spec: CourseFile) -> Mistakes:
    seen: dict[tuple[str, str], int] = {}
    used: Counter[str] = Counter()
    most = spec.tokens.each if spec.tokens is not None else 0
    for at, one in enumerate(spec.extensions):
        if one.assignment not in spec.assignments:
            nearest = nearest_or_all(one.assignment, spec.assignments)
            text = f"no assignment {one.assignment!r} in this file.{nearest}"
            yield ("extensions", at, "assignment"), text
        if [one.due, one.days, one.tokens].count(None) != 2:
            yield ("extensions", at), "give either `due`, `days` or `tokens`"
        used[comparable_name(one.student)] += one.tokens or 0
        if one.tokens and used[comparable_name(one.student)] > most:
            text = f"{one.student} uses {used[comparable_name(one.student)]} of {most} late tokens"
            yield ("extensions", at, "tokens"), text
        first = seen.setdefault((comparable_name(one.student), one.assignment), at)
        if first != at:
            line = source.line(("extensions", first))
            text = f"{one.student} has an extension for {one.assignment} already (line {line})"
            yield ("extensions", at), text
