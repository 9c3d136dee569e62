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
from grader.course.model import Attempts, CourseFile, Extension, Late
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
        own = self.spec.assignments[assignment]
        due = due_of_all = self.instant(own.due)
        for extension in self.spec.extensions:
            named = (extension.assignment, comparable_name(extension.student))
            if named == (assignment, comparable_name(student)):
                due = self._extended(extension, due_of_all)
        return Rules(
            due=due,
            due_of_all=due_of_all,
            closes=max(self.instant(own.closes), due) if own.closes else None,
            late=own.late or self.spec.late,
            attempts=own.attempts or self.spec.attempts,
        )

    def _extended(self, extension: Extension, due_of_all: datetime) -> datetime:
        if extension.due:
            return self.instant(extension.due)
        if extension.tokens and self.spec.tokens:
            return later(due_of_all, extension.tokens, self.spec.tokens.worth)
        return later(due_of_all, extension.days or 0, "day")

    def visible(self, assignment: str, now: datetime) -> frozenset[str]:
        """Which checks students may see at a time, by their visibility.

        Those of ``after_due_date`` are shown when the due time has passed for all, also with an
        extension, and the assignment is closed.
        """
        extensions = [one for one in self.spec.extensions if one.assignment == assignment]
        rules = [self.rules(assignment)]
        rules += [self.rules(assignment, extension.student) for extension in extensions]
        visible = {Visibility.VISIBLE.value}
        # The minute of the due time is still in time.
        if now >= max(one.closes or one.due for one in rules) + timedelta(minutes=1):
            visible.add(Visibility.AFTER_DUE_DATE.value)
            published = self.spec.assignments[assignment].published
            if published and now >= self.instant(published):
                visible.add(Visibility.AFTER_PUBLISHED.value)
        return frozenset(visible)

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
    mistakes = list(_unreadable_times(course))
    if not mistakes:
        mistakes += _contradictions(course)
    mistakes += _groups(source, course.spec)
    mistakes += _extensions(source, course.spec)
    if mistakes:
        raise AssignmentError(file, in_order(source.problem(*mistake) for mistake in mistakes))
    return course


def _times(course: Course) -> Iterator[tuple[Place, str]]:
    """Every time in the file."""
    for name, rules in course.spec.assignments.items():
        for key in ("due", "closes", "published"):
            text = getattr(rules, key)
            if text:
                yield ("assignments", name, key), text
    for index, extension in enumerate(course.spec.extensions):
        if extension.due:
            yield ("extensions", index, "due"), extension.due


def _unreadable_times(course: Course) -> Mistakes:
    for place, text in _times(course):
        try:
            course.instant(text)
        except ValueError as error:
            yield place, str(error)
            if course.spec.time_zone is None:
                # One line at the top corrects all of them.
                return


def _contradictions(course: Course) -> Mistakes:
    assignments = course.spec.assignments
    for name, rules in assignments.items():
        for key, text in (("closes", rules.closes), ("published", rules.published)):
            if text and course.instant(text) < course.instant(rules.due):
                yield ("assignments", name, key), f"is before the due time, {rules.due}"
    for index, extension in enumerate(course.spec.extensions):
        if extension.assignment in assignments and extension.due:
            due = assignments[extension.assignment].due
            if course.instant(extension.due) <= course.instant(due):
                yield ("extensions", index, "due"), f"is not later than the due time of all, {due}"


def _groups(source: Source, spec: CourseFile) -> Mistakes:
    places: dict[str, Place] = {}
    for index, members in enumerate(spec.groups):
        for number, member in enumerate(members):
            place: Place = ("groups", index, number)
            first = places.setdefault(comparable_name(member), place)
            if first != place:
                yield place, f"{member!r} is in a group already (line {source.line(first)})"


def _extensions(source: Source, spec: CourseFile) -> Mistakes:
    indices: dict[tuple[str, str], int] = {}
    used_tokens: Counter[str] = Counter()
    most_tokens = spec.tokens.each if spec.tokens is not None else 0
    for index, extension in enumerate(spec.extensions):
        student, assignment = comparable_name(extension.student), extension.assignment
        if assignment not in spec.assignments:
            nearest = nearest_or_all(assignment, spec.assignments)
            text = f"no assignment {assignment!r} in this file.{nearest}"
            yield ("extensions", index, "assignment"), text
        if [extension.due, extension.days, extension.tokens].count(None) != 2:
            yield ("extensions", index), "give either `due`, `days` or `tokens`"
        used_tokens[student] += extension.tokens or 0
        if extension.tokens and used_tokens[student] > most_tokens:
            text = f"{extension.student} uses {used_tokens[student]} of {most_tokens} late tokens"
            yield ("extensions", index, "tokens"), text
        first = indices.setdefault((student, assignment), index)
        if first != index:
            line = source.line(("extensions", first))
            text = f"{extension.student} has an extension for {assignment} already (line {line})"
            yield ("extensions", index), text
