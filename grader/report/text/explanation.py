"""What a result says, as plain words: the same in every format."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from typing import NamedTuple

from grader.findings.finding import Status
from grader.findings.words import counted, listing
from grader.grade.model import total
from grader.recording.submission import SourceError
from grader.report.model.excerpt import places as places_of
from grader.report.model.mistakes import others, reasons
from grader.report.model.result_model import CheckPart, FindingPart, Result
from grader.report.text import additions
from grader.report.text.words import (
    ADVICE,
    NO_POINTS,
    NOT_SO,
    STATUS,
    StatusWords,
    counted_points,
    cut,
    number,
)
from grader.spec.safe_text import clean, one_line

MOST_NOTES = 20
"""Notes of the runs under one title; a submission can cause any number of them."""
MOST_CHARACTERS = 500
"""Of a note; names in it are the student's."""


class Row(NamedTuple):
    """One part of an explanation, such as ``observed``; ``printed`` has several lines."""

    name: str
    text: str


def explain(check: CheckPart, result: Result) -> list[Row]:
    """Say why a check ended as it did; what is the same in several scenarios is said once."""
    same_advice: dict[tuple[str, ...], list[FindingPart]] = {}
    for finding in check.findings:
        if finding.status is check.status:
            same_advice.setdefault(advice(check, finding), []).append(finding)
    rows: list[Row] = []
    for texts, findings in same_advice.items():
        rows += _asked_and_observed(findings, several=len(check.findings) > 1)
        rows += [Row(ADVICE[min(index, 1)], one_line(text)) for index, text in enumerate(texts)]
        places = (one_line(str(place)) for finding in findings for place in places_of(finding))
        rows += [Row("where", place) for place in dict.fromkeys(places)]
        log = next((finding.evidence.log for finding in findings if finding.evidence.log), ())
        if log:
            rows.append(Row("printed", clean("\n".join(log))))
        concepts = dict.fromkeys(one_line(finding.concept) for finding in findings)
        rows += [Row("read", f"`rosgrade explain {concept}`") for concept in concepts if concept]
    if waits := points_waiting(check, result):
        rows.append(Row("waiting", waits))
    return rows


def _asked_and_observed(findings: Sequence[FindingPart], *, several: bool) -> Iterator[Row]:
    """What was expected and observed, once for all scenarios with the same."""
    scenarios: dict[tuple[str, str], list[str]] = {}
    for finding in findings:
        texts = (one_line(finding.expected), one_line(finding.observed))
        scenarios.setdefault(texts, []).append(one_line(finding.scenario or ""))
    said = None
    for (expected, observed), names in scenarios.items():
        if several and names[0]:
            yield Row("scenario", listing(names))
        if expected != said:
            yield Row("expected", expected)
        yield Row("observed", observed)
        said = expected


def advice(check: CheckPart, finding: FindingPart) -> tuple[str, ...]:
    """What to try next: the check's hint, then the author's own where a check failed."""
    author_hint = check.author_hint if finding.status is Status.FAILED else ""
    return tuple(dict.fromkeys(text for text in (finding.hint, author_hint) if text))


def spot(place: SourceError) -> str:
    """``file:line``, or only the file."""
    return f"{place.file}:{place.line}" if place.line else place.file


def plain(check: CheckPart, result: Result) -> str:
    """:func:`explain` as text, a line for each; several lines stand below their name."""
    lines = []
    for name, text in explain(check, result):
        separator = "\n" if "\n" in text else " "
        lines.append(f"{name}:{separator}{text}")
    return "\n".join(lines)


class Notes(NamedTuple):
    """What is worth knowing of the runs, a line each; between backticks stands code."""

    title: str
    lines: tuple[str, ...]


def names_taken(result: Result) -> list[Notes]:
    """What was taken for names that the assignment leaves free, and why."""
    taken = tuple(f"{one.name}: `{one.value}`, {one.why}" for one in result.names)
    return [Notes("Names that were taken", taken)] if taken else []


def notes_of_runs(result: Result) -> list[Notes]:
    """Names that were taken, limits of the sandbox, and what else is worth knowing."""
    reached = [(breach, run.id) for run in result.scenarios for breach in run.breaches]
    remarked = [(remark, run.id) for run in result.scenarios for remark in run.remarks]
    titled = (("Limits of the sandbox that were reached", reached), ("Worth knowing", remarked))
    return names_taken(result) + [Notes(title, _lines(notes)) for title, notes in titled if notes]


def _lines(notes: Sequence[tuple[str, str]]) -> tuple[str, ...]:
    """A line for each text, with all runs that it is about."""
    runs: dict[str, list[str]] = {}
    for text, run in notes:
        runs.setdefault(one_line(text), []).append(one_line(run))
    lines = [
        f"scenario{'s' if len(names) > 1 else ''} {listing(names)}: {cut(text, MOST_CHARACTERS)}"
        for text, names in list(runs.items())[:MOST_NOTES]
    ]
    left_out = len(runs) - len(lines)
    return (*lines, f"{left_out} more: see the report") if left_out else tuple(lines)


def heading(check: CheckPart) -> str:
    """The title of a check, with what says that it is not so: ``Not yet: Messages arrive``."""
    return f"{NOT_SO.get(check.status, '')}{check.title}"


def status_words(check: CheckPart) -> StatusWords:
    """The status of a check for people."""
    loses_nothing = check.status is Status.FAILED and not check.max_points
    return NO_POINTS if loses_nothing else STATUS[check.status]


def points(check: CheckPart) -> str:
    """``1.02 / 3``; what could not be judged has a question mark."""
    earned = "?" if check.status is Status.ERROR else number(check.points)
    return f"{earned} / {number(check.max_points)}"


def points_waiting(check: CheckPart, result: Result) -> str:
    """``4.25 points wait for this``: what is skipped because a check failed; or nothing.

    What waits for several checks is counted at the first of them.
    """
    points = total(one.max_points for one in result.checks if check.id in one.waits_for[:1])
    if not points:
        return ""
    return f"{counted_points(points)} {_waits(points)} for this"


def _waits(count: float) -> str:
    return "waits" if count == 1 else "wait"


def waiting(result: Result, check: CheckPart) -> str:
    """How many other checks a failed one keeps from passing, or nothing."""
    same, waiting = others(check.id, result.checks)
    if same:
        return f"{counted(same + waiting, 'other check')} did not pass for the same reason."
    if not waiting:
        return ""
    return f"{counted(waiting, 'other check')} {_waits(waiting)} for it."


def same_as(result: Result) -> dict[str, CheckPart]:
    """Failed checks that name the same mistake as one before them, by id: the first that does."""
    checks = {check.id: check for check in result.checks}
    first_with: dict[Hashable, str] = {}
    repeated = {}
    for check, reason in reasons(result.checks).items():
        first = first_with.setdefault(reason, check)
        if first != check:
            repeated[check] = checks[first]
    return repeated


def score(result: Result) -> str:
    """``7 of 10 points``, perhaps with what waits for a person, or that there is no score."""
    if result.known_score is None:
        return "Not graded"
    waits = additions.waiting(result)
    points = f"{number(result.known_score)} of {counted_points(result.final_max_score)}"
    return f"{points} so far; {waits}" if waits else points


def asks(result: Result) -> bool:
    """Whether there is no score because of a question to the student."""
    return any(finding.asks for check in result.open for finding in check.findings)


def way_on(result: Result) -> str:
    """What leads to a score where there is none."""
    if asks(result):
        return "Answer the question, and it is graded."
    return "This is not a fault of the submission: it can be graded again without changes."


def headline(result: Result) -> str:
    """One sentence on the whole, and what is judged only at grading."""
    text = _outcome(result) if result.graded else _not_graded(result)
    errors, withheld = len(result.of(Status.ERROR)), result.withheld
    if result.graded and errors:
        which = "" if result.settled else " without points"
        text += f"; {counted(errors, 'check')}{which} could not be judged"
    if withheld.checks:
        verb = "runs" if withheld.checks == 1 else "run"
        text += f"; {counted(withheld.checks, 'hidden check')}, "
        text += f"{counted_points(withheld.points)}, {verb} at grading"
    return f"{text}."


def _not_graded(result: Result) -> str:
    text = "Something failed in the grader or the machine; no points are lost"
    if asks(result):
        text = "It cannot be seen which name is meant; no points are lost"
    left = total(check.max_points for check in result.open)
    if left:
        earned = number(total(check.points for check in result.checks))
        text += f": {earned} of {number(result.max_score)} points so far, {number(left)} open"
    return text


def _outcome(result: Result) -> str:
    """How many checks passed, or failed."""
    every, passed = len(result.checks), len(result.of(Status.PASSED))
    failed, skipped = len(result.of(Status.FAILED)), len(result.of(Status.SKIPPED))
    if result.score == result.max_score > 0 or passed == every:
        text = "Full points for the checks" if result.adjustments else "Full points"
        if result.withheld.checks:
            text = f"{passed} of {every} visible checks passed"
        return f"{text}; {counted(failed, 'check')} without points failed" if failed else text
    if not failed:
        return f"{passed} of {counted(every, 'check')} passed"
    text = f"{counted(failed, 'check')} failed"
    if skipped:
        cause = "it" if failed == 1 else "them"
        text += f", {counted(skipped, 'other')} {_waits(skipped)} for {cause}"
    return text


def summary(result: Result) -> str:
    """The score with its adjustments, what failed and why, and what persons wrote.

    Args:
        result: As far as the student may see it.
    """
    lines = [f"{one_line(result.assignment.id)}: {score(result)}", headline(result)]
    lines += [f"  {additions.line(one)}" for one in result.adjustments]
    blocks = ["\n".join(lines)]
    if result.submission.problem:
        blocks.append(f"It could not be read: {one_line(result.submission.problem)}")
    for check in (*result.of(Status.FAILED), *result.of(Status.ERROR)):
        lines = [f"{one_line(heading(check))} ({points(check)} points)"]
        rows = explain(check, result)
        lines += [f"  {row.name}: {row.text}" for row in rows if row.name != "printed"]
        blocks.append("\n".join(lines))
    for comment in result.comments:
        who, where = one_line(comment.by), additions.place(comment)
        if where:
            who += f" ({where})"
        blocks.append(f"{who}:\n{clean(comment.text)}")
    return "\n\n".join(blocks) + "\n"
