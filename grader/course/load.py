"""``course.yaml`` from a file, with everything that must fit together in it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta, timezone
from pathlib import Path

from grader.assignment.model import Visibility
from grader.course.instant import instant
from grader.course.model import Attempts, CourseFile, Extension, Late, Tokens, points_of
from grader.errors import AssignmentError, Problem, UsageError
from grader.spec.document import Place
from grader.spec.nearest_name import nearest_or_all
from grader.spec.source import Source, in_order, read_source

COURSE_FILE = "course.yaml"


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
    tokens: Tokens | None
    attempts: Attempts | None


@dataclass(frozen=True)
class Course:
    """The rules of a course, all of which fit together."""

    file: Path
    spec: CourseFile

    def rules(self, assignment: str, student: str) -> Rules:
        """The rules for a student; an assignment that is not in the file is an error."""
        if assignment not in self.spec.assignments:
            nearest = nearest_or_all(assignment, self.spec.assignments)
            raise UsageError(f"{self.file}: has no assignment {assignment!r}.{nearest}")
        one = self.spec.assignments[assignment]
        plain = self._instant(one.due)
        own = [
            self._extended(each, plain)
            for each in self.spec.extensions
            if (each.assignment, login(each.student)) == (assignment, login(student))
        ]
        due = max([plain, *own])
        closes = self._instant(one.closes) if one.closes else None
        return Rules(
            due=due,
            due_of_all=plain,
            closes=max(closes, due) if closes else None,
            late=one.late or self.spec.late,
            tokens=self.spec.tokens,
            attempts=one.attempts or self.spec.attempts,
        )

    def visible(self, assignment: str, now: datetime) -> frozenset[str]:
        """Which checks students may see at a time, by their visibility.

        Those of ``after_due_date`` are shown when all due times of the class have passed, also
        the extended ones and the time when the assignment closes.
        """
        students = [one.student for one in self.spec.extensions if one.assignment == assignment]
        rules = [self.rules(assignment, student) for student in ("", *students)]
        shown = {Visibility.VISIBLE.value}
        if now >= max(one.closes or one.due for one in rules) + timedelta(minutes=1):
            shown.add(Visibility.AFTER_DUE_DATE.value)
            published = self.spec.assignments[assignment].published
            if published and now >= self._instant(published):
                shown.add(Visibility.AFTER_PUBLISHED.value)
        return frozenset(shown)

    def _instant(self, text: str) -> datetime:
        return instant(text, self.spec.time_zone)

    def _extended(self, extension: Extension, due: datetime) -> datetime:
        if extension.due is not None:
            return self._instant(extension.due)
        return due + timedelta(days=extension.days or 0)


def login(text: str) -> str:
    """A student's name as it is compared."""
    return " ".join(text.casefold().split())


def is_course(file: Path) -> bool:
    """Whether a file holds the rules of a course: by its name, as for all YAML of rosgrade."""
    return file.name == COURSE_FILE or file.name.endswith(f".{COURSE_FILE}")


def load_course(file: Path) -> Course:
    """Read the rules of a course; every mistake in them is named with its line."""
    source = read_source(file)
    spec = source.read(CourseFile)
    problems = [*_bad_times(source, spec)]
    if not problems:
        problems += _contradictions(source, Course(file, spec))
    problems += [*_groups(source, spec), *_extensions(source, spec)]
    if problems:
        raise AssignmentError(file, in_order(problems))
    return Course(file, spec)


def _bad_times(source: Source, spec: CourseFile) -> Iterator[Problem]:
    times: list[tuple[Place, str | None]] = [
        (("assignments", name, key), getattr(one, key))
        for name, one in spec.assignments.items()
        for key in ("due", "closes", "published")
    ]
    times += [(("extensions", at, "due"), one.due) for at, one in enumerate(spec.extensions)]
    for place, text in times:
        try:
            if text is not None:
                instant(text, spec.time_zone)
        except ValueError as error:
            yield source.problem(place, str(error))
            if spec.time_zone is None:
                # One line at the top corrects all of them.
                return


def _contradictions(source: Source, course: Course) -> Iterator[Problem]:
    spec = course.spec
    policies: list[tuple[Place, Late | None]] = [(("late",), spec.late)]
    costs = False
    for name, one in spec.assignments.items():
        place: Place = ("assignments", name)
        rules = course.rules(name, "")
        for key, text in (("closes", one.closes), ("published", one.published)):
            if text and utc(instant(text, spec.time_zone)) < utc(rules.due):
                yield source.problem((*place, key), f"is before the due time, {one.due}")
        policies.append(((*place, "late"), one.late))
        late, end = rules.late, utc(rules.closes or datetime.max.replace(tzinfo=timezone.utc))
        never = late is not None and end - utc(rules.due) <= timedelta(seconds=late.grace)
        if one.late and never:
            text = "never applies: the assignment closes before it would deduct anything"
            yield source.problem((*place, "late"), text)
        costs = costs or (late is not None and points_of(late.deduct, 1.0) > 0 and not never)
    for where, policy in policies:
        if policy is None or type(policy.deduct) is not type(policy.at_most):
            continue
        if points_of(policy.at_most or 0.0, 1.0) < points_of(policy.deduct, 1.0):
            text = f"is less than one {policy.per} costs, {policy.deduct}"
            yield source.problem((*where, "at_most"), text)
    if spec.tokens and not costs:
        text = "never apply: no assignment has a late policy that deducts anything"
        yield source.problem(("tokens",), text)
    for at, extension in enumerate(spec.extensions):
        if extension.assignment in spec.assignments and extension.due:
            due = spec.assignments[extension.assignment].due
            if utc(instant(extension.due, spec.time_zone)) <= utc(instant(due, spec.time_zone)):
                text = f"is not later than the due time of all, {due}"
                yield source.problem(("extensions", at, "due"), text)


def _groups(source: Source, spec: CourseFile) -> Iterator[Problem]:
    seen: dict[str, Place] = {}
    for at, members in enumerate(spec.groups if isinstance(spec.groups, tuple) else ()):
        for number, member in enumerate(members):
            place: Place = ("groups", at, number)
            first = seen.setdefault(login(member), place)
            if first != place:
                line = source.line(first)
                yield source.problem(place, f"{member!r} is in a group already (line {line})")


def _extensions(source: Source, spec: CourseFile) -> Iterator[Problem]:
    seen: dict[tuple[str, str], int] = {}
    for at, one in enumerate(spec.extensions):
        if one.assignment not in spec.assignments:
            nearest = nearest_or_all(one.assignment, spec.assignments)
            text = f"no assignment {one.assignment!r} in this file.{nearest}"
            yield source.problem(("extensions", at, "assignment"), text)
        if (one.due is None) == (one.days is None):
            yield source.problem(("extensions", at), "give either `due` or `days`")
        first = seen.setdefault((login(one.student), one.assignment), at)
        if first != at:
            line = source.line(("extensions", first))
            text = f"{one.student} has an extension for {one.assignment} already (line {line})"
            yield source.problem(("extensions", at), text)


def utc(moment: datetime) -> datetime:
    """A time in UTC, so that two of one zone are compared by when they are, not by the clock."""
    return moment.astimezone(timezone.utc)
