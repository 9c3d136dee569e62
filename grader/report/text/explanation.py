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
    for item in check.findings:
        if item.status is check.status:
            same_advice.setdefault(advice(check, item), []).append(item)
    rows: list[Row] = []
    for texts, items in same_advice.items():
        rows += _seen(items, several=len(check.findings) > 1)
        rows += [Row(ADVICE[min(index, 1)], one_line(text)) for index, text in enumerate(texts)]
        places = dict.fromkeys(one_line(str(place)) for item in items for place in places_of(item))
        rows += [Row("where", place) for place in places]
        log = next((item.evidence.log for item in items if item.evidence.log), ())
        if log:
            rows.append(Row("printed", clean("\n".join(log))))
        named = filter(None, dict.fromkeys(one_line(item.concept) for item in items))
        rows += [Row("read", f"`rosgrade explain {concept}`") for concept in named]
    if waits := points_waiting(check, result):
        rows.append(Row("waiting", waits))
    return rows


def _seen(items: Sequence[FindingPart], *, several: bool) -> Iterator[Row]:
    scenarios: dict[tuple[str, str], list[str]] = {}
    for item in items:
        key = (one_line(item.expected), one_line(item.observed))
        scenarios.setdefault(key, []).append(one_line(item.scenario or ""))
    before = None
    for (expected, observed), names in scenarios.items():
        if several and names[0]:
            yield Row("scenario", listing(names))
        if expected != before:
            yield Row("expected", expected)
        yield Row("observed", observed)
        before = expected


def advice(check: CheckPart, finding: FindingPart) -> tuple[str, ...]:
    """What to try next: the check's hint, then the author's own where a check failed."""
    own = check.author_hint if finding.status is Status.FAILED else ""
    return tuple(dict.fromkeys(text for text in (finding.hint, own) if text))


def spot(place: SourceError) -> str:
    """``file:line``, or only the file."""
    return f"{place.file}:{place.line}" if place.line else place.file


def plain(check: CheckPart, result: Result) -> str:
    """:func:`explain` as text, a line for each; several lines stand below their name."""
    rows = [(name, "\n" if "\n" in text else " ", text) for name, text in explain(check, result)]
    return "\n".join(f"{name}:{before}{text}" for name, before, text in rows)


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
    kinds = (("Limits of the sandbox that were reached", reached), ("Worth knowing", remarked))
    return names_taken(result) + [Notes(title, _lines(found)) for title, found in kinds if found]


def _lines(found: Sequence[tuple[str, str]]) -> tuple[str, ...]:
    runs: dict[str, list[str]] = {}
    for text, run in found:
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
    mild = check.status is Status.FAILED and not check.max_points
    return NO_POINTS if mild else STATUS[check.status]


def points(check: CheckPart) -> str:
    """``1.02 / 3``; what could not be judged has a question mark."""
    earned = "?" if check.status is Status.ERROR else number(check.points)
    return f"{earned} / {number(check.max_points)}"


def points_waiting(check: CheckPart, result: Result) -> str:
    """``4.25 points wait for this``: what is skipped because a check failed; or nothing.

    What waits for several checks is counted at the first of them.
    """
    lost = total(one.max_points for one in result.checks if check.id in one.waits_for[:1])
    return f"{counted_points(lost)} {'waits' if lost == 1 else 'wait'} for this" if lost else ""


def waiting(result: Result, check: CheckPart) -> str:
    """How many other checks a failed one keeps from passing, or nothing."""
    same, count = others(check.id, result.checks)
    if same:
        return f"{counted(same + count, 'other check')} did not pass for the same reason."
    verb = "waits" if count == 1 else "wait"
    return f"{counted(count, 'other check')} {verb} for it." if count else ""


def same_as(result: Result) -> dict[str, CheckPart]:
    """Failed checks that name the same mistake as one before them, by id: the first that does."""
    first: dict[Hashable, str] = {}
    found = {name: first.setdefault(why, name) for name, why in reasons(result.checks).items()}
    checks = {check.id: check for check in result.checks}
    return {name: checks[other] for name, other in found.items() if name != other}


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
    every, withheld = len(result.checks), result.withheld
    passed, failed, skipped, errors = (
        len(result.of(status))
        for status in (Status.PASSED, Status.FAILED, Status.SKIPPED, Status.ERROR)
    )
    full = "Full points for the checks" if result.adjustments else "Full points"
    if not result.graded:
        text = "Something failed in the grader or the machine; no points are lost"
        if asks(result):
            text = "It cannot be seen which name is meant; no points are lost"
        left = total(check.max_points for check in result.open)
        if left:
            earned = number(total(check.points for check in result.checks))
            text += f": {earned} of {number(result.max_score)} points so far, {number(left)} open"
    elif result.score == result.max_score > 0 or passed == every:
        text = f"{passed} of {every} visible checks passed" if withheld.checks else full
        if failed:
            text += f"; {counted(failed, 'check')} without points failed"
    else:
        text = f"{counted(failed, 'check')} failed"
        if not failed:
            text = f"{passed} of {counted(every, 'check')} passed"
        elif skipped:
            verb = "waits" if skipped == 1 else "wait"
            text += f", {counted(skipped, 'other')} {verb} for {'it' if failed == 1 else 'them'}"
    if result.graded and errors:
        which = "" if result.settled else " without points"
        text += f"; {counted(errors, 'check')}{which} could not be judged"
    if withheld.checks:
        verb = "runs" if withheld.checks == 1 else "run"
        text += f"; {counted(withheld.checks, 'hidden check')}, "
        text += f"{counted_points(withheld.points)}, {verb} at grading"
    return f"{text}."


def summary(result: Result) -> str:
    """The score with its adjustments, what failed and why, and what persons wrote.

    Args:
        result: As far as the student may see it.
    """
    head = f"{one_line(result.assignment.id)}: {score(result)}"
    lines = [head, headline(result)]
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
        where = additions.place(comment)
        who = f"{one_line(comment.by)}{f' ({where})' if where else ''}"
        blocks.append(f"{who}:\n{clean(comment.text)}")
    return "\n\n".join(blocks) + "\n"
