"""The class overview: one page for all submissions of an assignment.

Everything is in the page as a plain table; its script only filters and sorts.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean, median
from urllib.parse import quote

from grader.findings.finding import Status
from grader.report.drawing.distribution import draw_distribution
from grader.report.html.page import render_page
from grader.report.model.class_row import ClassRow, RowStatus
from grader.report.model.cluster import Cluster
from grader.report.model.result_model import ScenarioPart
from grader.spec.safe_text import one_line

MOST_DISTURBED = 50
MOST_SHOWN = 500
"""Rows of the table until all are asked for."""
MOST_CLUSTERS = 30
MOST_NAMED = 20
"""Students that are named in one line."""
_UNGRADED = (RowStatus.NOT_GRADED, RowStatus.UNREADABLE, RowStatus.MISSING)


@dataclass(frozen=True)
class Column:
    """A check over the whole class; ``counts`` says how often it ended how."""

    id: str
    title: str
    counts: Counter[Status]


def render_overview(
    rows: Sequence[ClassRow],
    clusters: Sequence[Cluster] = (),
    vanished: Sequence[str] = (),
    pages: Sequence[str] = (),
    link: Callable[[ClassRow], str] | None = None,
    links: Mapping[str, str] = {},
) -> str:
    """Render the overview of a class; its links are relative to the folder that it lies in.

    Args:
        link: Where a row leads; by default to its report.
        links: Addresses of other pages by what they are called, for the overview of a review.
        clusters: Failures with the same cause, the most frequent first.
        vanished: Students with a review who are not in the class any more.
        pages: Files with pages for the instructor.
    """
    columns = _columns(rows)
    scores = [row.score for row in rows if row.score is not None]
    most = max((row.result.final_max_score for row in rows if row.result is not None), default=0.0)
    failed = [column for column in columns if column.counts[Status.FAILED]]
    return render_page(
        "overview.html.j2",
        ("report.css", "overview.css"),
        "overview.js",
        assignments=sorted({row.result.assignment.id for row in rows if row.result}),
        rows=rows,
        most_shown=MOST_SHOWN,
        columns=columns,
        failed_most=sorted(failed, key=lambda column: -column.counts[Status.FAILED]),
        cells=[{check.id: check for check in row.judged} for row in rows],
        scores=scores,
        middle=median(scores) if scores else 0.0,
        mean=fmean(scores) if scores else 0.0,
        most=most,
        distribution=draw_distribution(scores, most, "distribution"),
        ungraded=[row for status in _UNGRADED for row in rows if row.status is status],
        counts=Counter(row.status for row in rows),
        RowStatus=RowStatus,
        why=_why_ungraded,
        disturbed=_disturbed(rows),
        link=link or _link,
        pages=pages,
        rows_by_id={row.id: row for row in rows},
        clusters=[one for one in clusters if len(one.lost) > 1][:MOST_CLUSTERS],
        waiting=[row for row in rows if row.status is RowStatus.WAITING],
        vanished=vanished,
        links=links,
        MOST_NAMED=MOST_NAMED,
    )


def _columns(rows: Sequence[ClassRow]) -> list[Column]:
    """Every check of the class, in the order of the assignment."""
    found: dict[str, Column] = {}
    for row in rows:
        for check in row.judged:
            column = found.setdefault(check.id, Column(check.id, check.title, Counter()))
            column.counts[check.status] += 1
    return list(found.values())


def _link(row: ClassRow) -> str:
    """Where the report of a row is; nothing where it has none.

    Quoted, so that a name never becomes a scheme or another host.
    """
    if row.report is None:
        return ""
    return "./" + quote(row.report.lstrip("/").encode("utf-8", "surrogateescape"))


def _why_ungraded(row: ClassRow) -> str:
    """Why a row has no score, in the words of the first error."""
    if row.result is not None:
        if row.result.submission.problem:
            return row.result.submission.problem
        for check in row.result.of(Status.ERROR):
            return f"{one_line(check.title)}: {one_line(check.observed)}"
    return row.note or "nothing was graded"


def _disturbed(rows: Sequence[ClassRow]) -> list[tuple[ClassRow, ScenarioPart]]:
    """The runs that were repeated or could not be used, the most repeated first."""
    found = [(row, run) for row in rows if row.result is not None for run in row.result.scenarios]
    found = [(row, run) for row, run in found if run.disturbed]
    found.sort(key=lambda item: (-item[1].runs, -item[1].disturbance.taken_s))
    return found[:MOST_DISTURBED]
