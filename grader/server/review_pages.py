"""The pages of a review as HTML."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from urllib.parse import quote

from markupsafe import Markup

from grader.assignment.load import LoadedAssignment
from grader.findings.finding import Status
from grader.report.html.overview import render_overview
from grader.report.html.page import environment, render_page
from grader.report.html.source_code import code_lines
from grader.report.model.class_row import ClassRow
from grader.report.model.result_model import CheckPart
from grader.review.cluster import Cluster
from grader.server.regrading import Regrading
from grader.server.reviewed_class import ReviewedClass, ReviewedRow

MOST_CLUSTERS = 60
_STYLES = ("report.css", "review.css")
_POLICY = "; connect-src 'self'; frame-src 'self'"
_AROUND = 4
"""Lines of source that are shown before and after a place."""


@dataclass(frozen=True)
class Example:
    """What one student of a cluster did; ``first`` is the number of the first line of ``code``."""

    row: ReviewedRow
    check: CheckPart
    place: str
    first: int
    code: Sequence[Markup]


def render_class(reviewed: ReviewedClass, found: Sequence[Cluster]) -> str:
    """The overview of the class, whose rows lead to their reviews."""
    rows = reviewed.rows()
    names = {row.row.id: row.name for row in rows}

    def link(row: ClassRow) -> str:
        return f"s/{quote(names[row.id])}/"

    pages = {"Causes of failures": "clusters", "Regrade": "regrade"}
    first = next((row.row for row in rows if row.row.waits_for), None)
    if first is not None:
        pages = {"Review the first that waits": f"{link(first)}?waiting", **pages}
    for file in sorted((reviewed.out / "instructor").glob("*.html")):
        pages[file.stem.capitalize()] = f"instructor/{quote(file.name)}"
    vanished = reviewed.store.vanished({row.key for row in rows})
    return render_overview([row.row for row in rows], found, vanished, (), link, pages)


def render_submission(
    reviewed: ReviewedClass, row: ReviewedRow, rows: Sequence[ReviewedRow], *, only_waiting: bool
) -> str:
    """The page of one submission: report and source, and beside them what a person writes."""
    at = rows.index(row)
    wanted = [one for one in rows if one.row.waits_for or not only_waiting]
    source = reviewed.source(row)
    return render_page(
        "review.html.j2",
        _STYLES,
        "review.js",
        _POLICY,
        row=row,
        number=at + 1,
        count=len(rows),
        before=next((one for one in reversed(wanted) if rows.index(one) < at), None),
        after=next((one for one in wanted if rows.index(one) > at), None),
        only_waiting=only_waiting,
        waiting=sum(bool(one.row.waits_for) for one in rows),
        source=source,
        link=lambda one: f"../{quote(one.name)}/",
        panel=Markup(render_panel(reviewed, row)),
    )


def render_panel(reviewed: ReviewedClass, row: ReviewedRow, saved: str = "") -> str:
    """What is written about one submission, and what can be."""
    adjustments = row.row.result.adjustments if row.row.result is not None else ()
    return _part(
        "review_panel.html.j2",
        row=row,
        result=row.row.result,
        items=[one for one in adjustments if one.kind == "manual" and one.item],
        others=[one for one in adjustments if one.kind != "manual"],
        levels=reviewed.levels(),
        bank=reviewed.of_class().bank[:30],
        findings=[check for check in row.row.judged if check.status is not Status.PASSED],
        saved=saved,
    )


def render_code(path: str, text: str) -> str:
    """A file of the source, each line with a button to comment it."""
    return _part("review_code.html.j2", lines=code_lines(path, text))


def render_clusters(reviewed: ReviewedClass, found: Sequence[Cluster]) -> str:
    """The causes of failures, each with its students and what to do about it."""
    rows = {row.row.id: row for row in reviewed.rows()}
    saved = reviewed.store.of_class()
    shown = found[:MOST_CLUSTERS]
    return render_page(
        "review_clusters.html.j2",
        _STYLES,
        "review_clusters.js",
        _POLICY,
        clusters=shown,
        left=len(found) - len(shown),
        examples=[list(_examples(reviewed, cluster, rows)) for cluster in shown],
        rows=rows,
        bank=saved.content.bank[:30],
        version=saved.version,
        link=lambda key: f"s/{quote(rows[key].name)}/",
    )


def render_regrading(
    reviewed: ReviewedClass,
    job: Regrading,
    check: str,
    lines: tuple[int, str],
    back: LoadedAssignment | None,
) -> str:
    """The editor of a check, and who gains or loses what by the change."""
    return render_page(
        "review_regrade.html.j2",
        _STYLES,
        "review_regrade.js",
        _POLICY,
        check=check,
        first=lines[0],
        text=lines[1],
        job=job,
        changed=job.changed,
        back=back,
        loaded=reviewed.loaded,
    )


def _examples(
    reviewed: ReviewedClass, cluster: Cluster, rows: dict[str, ReviewedRow]
) -> Iterator[Example]:
    for key in cluster.keys[:2]:
        row = rows[key]
        check = next(one for one in row.row.judged if one.id == cluster.check)
        place = next((one for one in check.evidence.places if one.line), None)
        text = reviewed.source(row).files.get(place.file) if place is not None else None
        if place is None or place.line is None or text is None:
            yield Example(row, check, "", 1, ())
            continue
        begin = max(0, place.line - 1 - _AROUND)
        code = code_lines(place.file, text)[begin : place.line + _AROUND]
        yield Example(row, check, f"{place.file}:{place.line}", begin + 1, code)


def _part(template: str, **values: object) -> str:
    return environment().get_template(template).render(values)
