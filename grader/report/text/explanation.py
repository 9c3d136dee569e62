"""What a check of a result says, as plain words: the same in every format without pictures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from grader.assignment.model import Withheld
from grader.checks.finding import Status
from grader.grade import first
from grader.report.model.result_model import CheckPart, FindingPart, PlacePart, Result
from grader.report.text import words
from grader.safe_text import clean, one_line

MOST_NOTES = 20
"""Notes of the runs under one title; a submission can cause any number of them."""
MOST_CHARACTERS = 500
"""Of a note; names in it are the student's."""


@dataclass(frozen=True)
class Row:
    """One thing that is said.

    Attributes:
        name: What it is: ``expected``, ``observed``, ``try next``, ``also``, ``where``,
            ``printed`` or ``waiting``.
        text: Cleaned; ``printed`` has several lines.
    """

    name: str
    text: str


@dataclass(frozen=True)
class Notes:
    """What is worth knowing of the runs, beside the checks.

    Attributes:
        notes: Scenario and text of each, in one line each; between backticks stands code.
    """

    title: str
    notes: tuple[tuple[str, str], ...]
    left_out: int

    @property
    def rest(self) -> str:
        """What to say of the notes that are left out; nothing where there are none."""
        return f"{self.left_out} more: see the report" if self.left_out else ""


def notes_of_runs(result: Result) -> tuple[Notes, ...]:
    """Limits of the sandbox that were reached, and what else is worth knowing."""
    reached = [(run.id, breach) for run in result.scenarios for breach in run.breaches]
    remarked = [(run.id, remark) for run in result.scenarios for remark in run.remarks]
    kinds = ((words.LIMITS_REACHED, reached), (words.WORTH_KNOWING, remarked))
    return tuple(_notes(title, told) for title, told in kinds if told)


def _notes(title: str, told: Sequence[tuple[str, str]]) -> Notes:
    kept = tuple((one_line(run), _cut(one_line(text))) for run, text in told[:MOST_NOTES])
    return Notes(title, kept, len(told) - len(kept))


def _cut(text: str) -> str:
    return text if len(text) <= MOST_CHARACTERS else f"{text[: MOST_CHARACTERS - 1]}…"


def explain(check: CheckPart, result: Result) -> tuple[Row, ...]:
    """Say why a check ended as it did, every scenario that did not pass in its turn."""
    findings = [check, *check.other_scenarios]
    told = [item for item in findings if item.status is check.status]
    rows = [row for item in told for row in _rows(check, item, many=len(findings) > 1)]
    if points := words.points_waiting(check.id, result.checks):
        rows.append(Row("waiting", points))
    return tuple(rows)


def _rows(check: CheckPart, finding: FindingPart, *, many: bool) -> Iterator[Row]:
    if many and finding.scenario:
        yield Row("scenario", one_line(finding.scenario))
    yield Row("expected", one_line(finding.expected))
    yield Row("observed", one_line(finding.observed))
    own = check.author_hint if finding.status is Status.FAILED else ""
    advice = dict.fromkeys(text for text in (finding.hint, own) if text)
    for number, text in enumerate(advice):
        yield Row(words.ADVICE[min(number, 1)], one_line(text))
    for place in finding.evidence.places:
        yield Row("where", where(place))
    if finding.evidence.log:
        yield Row("printed", clean("\n".join(finding.evidence.log)))


def where(place: PlacePart) -> str:
    """``file:line: message`` in one line."""
    line = f":{place.line}" if place.line else ""
    return one_line(f"{place.file}{line}: {place.message}")


def plain(check: CheckPart, result: Result) -> str:
    """:func:`explain` as text, a line for each; several lines stand below their name."""
    return "\n".join(_told(row) for row in explain(check, result))


def _told(row: Row) -> str:
    gap = "\n" if "\n" in row.text else " "
    return f"{row.name}:{gap}{row.text}"


def points(check: CheckPart) -> str:
    """``1.02 / 3``; what could not be judged has a question mark."""
    earned = "?" if check.status is Status.ERROR else words.number(check.points)
    return f"{earned} / {words.number(check.max_points)}"


def only_shown(result: Result) -> frozenset[str]:
    """Ids of the checks without points that did not pass, and that nothing else waits for."""
    mild = [
        check.id
        for check in result.checks
        if check.status in (Status.FAILED, Status.ERROR) and not check.max_points
    ]
    return first.only_shown(mild, (check.waits_for for check in result.checks))


def headline(result: Result) -> str:
    """The headline of the report, from a result."""
    withheld = Withheld(result.withheld.checks, result.withheld.points)
    full_points = result.score == result.max_score > 0
    statuses = [check.status for check in result.checks]
    return words.summary(statuses, withheld, graded=result.graded, full_points=full_points)


def score(result: Result) -> str:
    """``7 of 10 points``, or that there is no score."""
    if result.score is None:
        return "Not graded"
    return f"{words.number(result.score)} of {words.counted_points(result.max_score)}"
